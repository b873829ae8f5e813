#!/usr/bin/env python3
"""Reads datagrams of STANAG 4586 with the decoder of synapse-cdm, which nobody here wrote.

Purpose. A judge from outside: what it makes of each datagram, for `cargo xtask synapse` to compare.

Design. A datagram a line in hexadecimal digits on standard input, a line of JSON for each on standard
output, at once: either "refused" with its reason, or "frames" with wrapper, defects, and the fields of those
messages that it knows, each as the integer on the wire and as the value that it has by its own scale.

Limits. With --fixtures it prints the folder of the decoder's own fixtures instead.
"""

import json
import sys
from pathlib import Path

import synapse_cdm
from synapse_cdm.adapters import stanag4586_codec as codec


def fields(frame):
    """Its fields by their index, or none if the message is not one that the decoder knows."""
    if frame.wrapper.message_type not in codec.MESSAGES:
        return None
    message = codec.decode_message(frame)
    return {
        "values": {
            str(index): {
                "raw": field.raw,
                "value": field.value.isoformat() if field.spec.kind == "timestamp" else field.value,
            }
            for index, field in message.fields.items()
        },
        "trailing": len(message.trailing_octets),
    }


def verdict(datagram):
    try:
        frames = codec.decode_frames(datagram)
        return {
            "frames": [
                {
                    "message": frame.wrapper.message_type,
                    "idd": frame.wrapper.idd_version,
                    "source": frame.wrapper.source_id,
                    "destination": frame.wrapper.destination_id,
                    "acknowledge": frame.wrapper.ack_requested,
                    "length": len(frame.data),
                    "sum_length": frame.checksum_octets,
                    "defects": [defect["kind"] for defect in frame.defects],
                    "fields": fields(frame),
                }
                for frame in frames
            ]
        }
    except codec.Stanag4586DecodeError as error:
        return {"refused": str(error)}


def main():
    if sys.argv[1:] == ["--fixtures"]:
        print(Path(synapse_cdm.__file__).parent / "fixtures" / "stanag4586")
        return
    for line in sys.stdin:
        print(json.dumps(verdict(bytes.fromhex(line))), flush=True)


main()
