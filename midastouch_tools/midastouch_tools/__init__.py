"""The `midastouch` command: recordings, datasets, pictures, the demo, training."""
