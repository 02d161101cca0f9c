"""Touch, slide and lift with an arm that follows twists, by what a tactile sensor measures."""
