"""How far one touch alone tells where the sensor is."""
