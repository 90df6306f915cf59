"""The fine-pointing loop: disturbances, sensors and a controller around a mirror, linear and simulated."""
