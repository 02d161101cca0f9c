"""Other methods on the same slides, called as the filter is."""
