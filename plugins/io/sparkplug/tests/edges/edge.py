"""An edge node for tests: mqtt_spb_wrapper, which publishes the value of each order on its standard input, a JSON object a line."""
import json
import sys
import time

from mqtt_spb_wrapper import MqttSpbEntityEdgeNode

edge = MqttSpbEntityEdgeNode("plant", "edge", include_spb_rebirth=False)
edge.commands.set_value("Node Control/Rebirth", False)
edge.data.set_value("T", 20.0)


def born(_):
    edge.publish_birth()
    print("rebirth", flush=True)


edge.on_command = born
edge.connect("127.0.0.1", int(sys.argv[1]))
while not edge.is_connected():
    time.sleep(0.02)
edge.publish_birth()
print("ready", flush=True)
for line in sys.stdin:
    edge.data.set_value("T", float(json.loads(line)["value"]), timestamp=int(time.time() * 1000))
    edge.publish_data()
    print("{}", flush=True)
