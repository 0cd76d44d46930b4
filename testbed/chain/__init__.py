"""The chain that joins motion, turntable, sensors and fusion, and the runs that are made with it."""
