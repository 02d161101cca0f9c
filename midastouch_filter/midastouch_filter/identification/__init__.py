"""Which object of a catalogue is touched."""
