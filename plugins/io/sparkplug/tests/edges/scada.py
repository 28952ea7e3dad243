"""A host for tests: mqtt_spb_wrapper, which prints each message that it takes as a JSON object, and asks for a birth by a line of its standard input."""
import json
import sys
import time

from mqtt_spb_wrapper import MqttSpbEntityScada


def told(kind):
    def say(_, payload):
        print(json.dumps({"of": kind, **payload}, default=str), flush=True)

    return say


scada = MqttSpbEntityScada(
    "plant", "scada", callback_birth=told("birth"), callback_data=told("data"), callback_death=told("death")
)
scada.connect("127.0.0.1", int(sys.argv[1]))
while not scada.is_connected():
    time.sleep(0.02)
print("ready", flush=True)
for line in sys.stdin:
    scada.send_command("Node Control/Rebirth", True, "tester", None)
