"""Read an MCAP file by its index and print counts, order, schemas and attachments as JSON.

Runs in an environment of its own with another version of the library; imports nothing of ours.
"""

import collections
import json
import sys

from mcap.reader import make_reader


def main(path):
    """Print what the reader finds in the file."""
    counts = collections.Counter()
    times = []
    with open(path, "rb") as stream:
        reader = make_reader(stream)
        for _, channel, message in reader.iter_messages():
            counts[channel.topic] += 1
            times.append(message.log_time)
        schemas = sorted(schema.name for schema in reader.get_summary().schemas.values())
        attachments = [attachment.name for attachment in reader.iter_attachments()]
    found = {
        "counts": counts,
        "ordered": times == sorted(times),
        "schemas": schemas,
        "attachments": attachments,
    }
    print(json.dumps(found))


main(sys.argv[1])
