"""What the method bears: each subject a module, each attempt a row; `make extremes`."""
