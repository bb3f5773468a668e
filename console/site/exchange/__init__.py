"""The state of one machine for other systems: MTConnect agents and MQTT brokers. It reads the state feed only."""
