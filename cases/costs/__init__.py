"""What a run costs: time, memory and accuracy."""
