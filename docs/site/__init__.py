"""The site of these pages: what stands on a page, that its commands are right and run, how it is built."""
