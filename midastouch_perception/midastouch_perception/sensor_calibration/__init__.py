"""What one sensor's colours say of slopes: found from presses of a ball or poses on an object, kept in a file."""
