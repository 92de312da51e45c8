"""What a camera has measured, held against what was predicted."""
