"""A client of Palpate, the server of soft tissue that several people touch at once (protocol palpate.v2).

    import palpate

    with palpate.join("ws://127.0.0.1:8090/ws") as session:
        first = session.frame()                     # shape of part 0: positions_m, float32 [n][3]
        pose = session.move([0.0, 0.0, 0.05])       # m, scene frame
        print(session.force_N(after=pose))          # N, of the tissue on the own tool
        print(session.order("probe", x_m=0.0, y_m=0.0, z_m=0.04).numbers)

All numbers are SI, axes are right-handed and those of the scene, quaternions are w x y z. Everything that goes wrong
is a PalpateError whose text is one sentence.
"""

from .asset import Asset, decode_asset
from .control import read_control
from .errors import Disconnected, OrderRefused, PalpateError, TookTooLong, WireError
from .field import FIELD_NAMES, Field, decode_field
from .frame import Frame, FrameDecoder
from .interior import Interior, decode_interior, tetrahedra_of
from .session import Answer, Session, join
from .ticket import Ticket, read_keys, read_ticket, ticket_session, write_ticket
from .topology_delta import TopologyDelta, decode_topology_delta
from .web import end_session, open_session, sessions
from .wire import ContactPatch, Grasp, Haptic, Pose, Tool, Tools, read_haptic, read_tools, write_ack, write_pose

__all__ = [
    "Answer",
    "Asset",
    "ContactPatch",
    "Disconnected",
    "FIELD_NAMES",
    "Field",
    "Frame",
    "FrameDecoder",
    "Grasp",
    "Haptic",
    "Interior",
    "OrderRefused",
    "PalpateError",
    "Pose",
    "Session",
    "Ticket",
    "TookTooLong",
    "Tool",
    "Tools",
    "TopologyDelta",
    "WireError",
    "decode_asset",
    "decode_field",
    "decode_interior",
    "decode_topology_delta",
    "end_session",
    "join",
    "open_session",
    "read_control",
    "read_haptic",
    "read_keys",
    "read_ticket",
    "read_tools",
    "sessions",
    "tetrahedra_of",
    "ticket_session",
    "write_ack",
    "write_pose",
    "write_ticket",
]
