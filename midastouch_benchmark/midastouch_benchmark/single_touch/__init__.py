"""Single-touch localisation: the pose of the sensor from one touch alone."""
