"""The description of a lathe for an MTConnect agent: its components and data items as Devices.xml. Pure."""

from __future__ import annotations

import re
from xml.etree import ElementTree as Xml

from console.site.exchange.conditions import TYPES
from console.site.exchange.data_items import CONTROLLER, DEVICE, ITEMS, PATH, C, DataItem, X, Z

SCHEMA = "1.7"
NAMESPACE = f"urn:mtconnect.org:MTConnectDevices:{SCHEMA}"
_SIM = "-SIM"
_AXES = ((X, "Linear", "X"), (Z, "Linear", "Z"), (C, "Rotary", "C"))
_HEADER = {
    "creationTime": "2026-01-01T00:00:00Z",  # agents write their own
    "sender": "trilobe",
    "instanceId": "1",
    "version": f"{SCHEMA}.0.0",
    "bufferSize": "131072",
    "assetBufferSize": "1024",
    "assetCount": "0",
}


def device_name(machine: str, simulated: bool) -> str:
    """Return the name of the device: that of its machine profile; a simulated one can be told from a real one."""
    return f"{machine}{_SIM if simulated else ''}"


def devices_xml(machine: str, simulated: bool, lathe_id: str) -> str:
    """Return the document for an agent. Its ids have the device in them: an agent may serve several.

    Profiles of many lathes have one name: the uuid has the identity of the lathe in it, and stays with it.
    """
    name = device_name(machine, simulated)
    root = Xml.Element("MTConnectDevices", {"xmlns": NAMESPACE})
    Xml.SubElement(root, "Header", _HEADER)
    facts = {"id": _id(name, DEVICE), "name": name, "uuid": f"trilobe.{lathe_id}.{name}"}
    device = Xml.SubElement(Xml.SubElement(root, "Devices"), "Device", facts)
    about = Xml.SubElement(device, "Description", {"manufacturer": "trilobe"})
    about.text = "SIMULATED lathe, nothing is machined" if simulated else "Lathe with a fast tool axis"
    _data_items(device, name, DEVICE)
    components = Xml.SubElement(device, "Components")
    axes = Xml.SubElement(components, "Axes", {"id": _id(name, "axes"), "name": "axes"})
    of_axes = Xml.SubElement(axes, "Components")
    for key, element, axis in _AXES:
        _data_items(_component(of_axes, element, name, key, axis), name, key)
    controller = _component(components, "Controller", name, CONTROLLER, CONTROLLER)
    _conditions(Xml.SubElement(controller, "DataItems"), name)
    path = _component(Xml.SubElement(controller, "Components"), "Path", name, PATH, PATH)
    _data_items(path, name, PATH)
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode")


def _component(parent: Xml.Element, element: str, name: str, key: str, shown: str) -> Xml.Element:
    return Xml.SubElement(parent, element, {"id": _id(name, key), "name": shown})


def _data_items(parent: Xml.Element, name: str, component: str) -> None:
    held = Xml.SubElement(parent, "DataItems")
    for item in ITEMS:
        if item.component == component:
            Xml.SubElement(held, "DataItem", _facts(item, name))


def _facts(item: DataItem, name: str) -> dict[str, str]:
    facts = {"id": _id(name, item.key), "name": item.key, "category": item.kind, "type": item.type}
    if item.sub_type is not None:
        facts["subType"] = item.sub_type
    if item.units is not None:
        facts |= {"units": item.units, "nativeUnits": item.units}
    return facts


def _conditions(held: Xml.Element, name: str) -> None:
    for key, kind in TYPES.items():
        facts = {"id": _id(name, key), "name": key, "category": "CONDITION", "type": kind}
        Xml.SubElement(held, "DataItem", facts)


def _id(name: str, key: str) -> str:
    """Return an id as XML allows it: no space, and a letter first."""
    return f"d_{re.sub(r'[^A-Za-z0-9_.-]', lambda found: f'_{ord(found[0]):x}', name)}_{key}"
