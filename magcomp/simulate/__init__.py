"""A vehicle to work on when there is none: ArduCopter 4.6's behaviour on MAVLink."""
