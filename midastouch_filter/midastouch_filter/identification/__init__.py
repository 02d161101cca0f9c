"""Identification of the touched object among those of a catalogue."""
