"""Problems with known answers: exact solutions, published benchmarks, patches, the shipped body."""
