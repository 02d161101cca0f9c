"""Launch, configuration, recordings, exploration and the midastouch command."""
