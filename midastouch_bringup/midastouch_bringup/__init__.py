"""Launch, configuration, datasets, evaluation and the midastouch command."""
