"""What leaves the lathe: MTConnect, MQTT, Prometheus, the database of a shop, studies, versions of the data."""
