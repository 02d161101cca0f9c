"""Touches, slides and lifts of an arm that follows twists, controlled by the measurements of a tactile sensor."""
