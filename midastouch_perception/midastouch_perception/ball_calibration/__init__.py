"""What one sensor's colours say about slopes, learned from presses of a ball whose diameter is known."""
