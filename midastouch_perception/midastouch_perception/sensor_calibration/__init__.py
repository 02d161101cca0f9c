"""What one sensor's colours say of slopes: found from presses of a ball, kept in a file."""
