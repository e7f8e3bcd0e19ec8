"""Drops a file on a window, as a file manager does (XDND, version 5).
Usage: drop_file.py WINDOW FILE."""
import pathlib
import sys
import time

import Xlib.display
from Xlib import X
from Xlib.protocol import event

TARGET, FILE = int(sys.argv[1]), pathlib.Path(sys.argv[2]).resolve()
VERSION = 5

display = Xlib.display.Display()
screen = display.screen()
target = display.create_resource_object("window", TARGET)
source = screen.root.create_window(0, 0, 1, 1, 0, screen.root_depth)


def atom(name):
    return display.intern_atom(name)


def send(name, *data):
    words = [source.id, *data] + [0] * (4 - len(data))
    target.send_event(event.ClientMessage(window=target, client_type=atom(name), data=(32, words)))
    display.flush()


def await_event(wanted, what):
    """The next event that is wanted, while the selection is served to whoever asks for it."""
    end = time.time() + 30
    while time.time() < end:
        if not display.pending_events():
            time.sleep(0.01)
            continue
        happened = display.next_event()
        if happened.type == X.SelectionRequest:
            happened.requestor.change_property(happened.property, happened.target, 8,
                                               (FILE.as_uri() + "\r\n").encode())
            happened.requestor.send_event(event.SelectionNotify(
                time=happened.time, requestor=happened.requestor, selection=happened.selection,
                target=happened.target, property=happened.property))
            display.flush()
        elif wanted(happened):
            return happened
    sys.exit(f"no {what} from the window")


def is_message(name):
    return lambda e: e.type == X.ClientMessage and e.client_type == atom(name)


source.set_selection_owner(atom("XdndSelection"), X.CurrentTime)
place = target.translate_coords(screen.root, 0, 0)
x, y = 20 - place.x, 20 - place.y
send("XdndEnter", VERSION << 24, atom("text/uri-list"), 0)
send("XdndPosition", 0, x << 16 | y, X.CurrentTime, atom("XdndActionCopy"))
status = await_event(is_message("XdndStatus"), "answer")
if not status.data[1][1] & 1:
    sys.exit("the window refuses the file")
send("XdndDrop", 0, X.CurrentTime)
await_event(is_message("XdndFinished"), "end of the drop")
