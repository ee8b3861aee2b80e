"""Recovery of a truncated or damaged MCAP file: its intact records go into a new, complete file."""

from __future__ import annotations

from pathlib import Path

import msgspec
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from comms.errors import LogError
from comms.log_scan import LogContent, Recovery, scan
from comms.mcap_log import DAMAGE_ERRORS

CHUNK_BYTES = 256 * 1024
METADATA_NAME = "recovery"


def recover(source: Path, target: Path) -> Recovery:
    """Write the intact records of source to target, a complete MCAP file, and verify it.

    Works on any MCAP file. target is replaced only after its verification. Raises LogError for a
    file that cannot be read or has no intact record, for a target that is the source, and where the
    written file does not verify; OSError where it cannot be written.
    """
    if target.exists() and source.exists() and target.samefile(source):
        raise LogError(f"{target}: is the damaged file itself; name another file to write")
    try:
        data = source.read_bytes()
    except OSError as error:
        raise LogError(f"{source}: {error.strerror}; name a run folder or its run.mcap") from error
    found = Recovery()
    content = scan(data, found)
    if not (content.messages or content.metadata or content.attachments):
        raise LogError(
            f"{source}: no intact record of an MCAP file in {len(data)} bytes; nothing to recover"
        )
    draft = target.with_name(f".new-{target.name}")
    try:
        _write(content, found, source, draft)
        _verify(draft, found)
        draft.replace(target)
    finally:
        draft.unlink(missing_ok=True)
    return found


def _write(content: LogContent, found: Recovery, source: Path, draft: Path) -> None:
    profile = content.header[0].profile if content.header else ""
    with draft.open("wb") as stream:
        writer = Writer(stream, CHUNK_BYTES, CompressionType.ZSTD, enable_data_crcs=True)
        writer.start(profile=profile, library="swayless recover")
        for metadata in content.metadata:
            writer.add_metadata(metadata.name, dict(metadata.metadata))
        for item in content.attachments:
            writer.add_attachment(
                item.create_time, item.log_time, item.name, item.media_type, item.data
            )
        channels = _register(writer, content)
        for message in content.messages:
            channel = channels.get(message.channel_id)
            if channel is None:
                found.messages_without_channel += 1
                continue
            writer.add_message(
                channel, message.log_time, message.data, message.publish_time, message.sequence
            )
            found.messages += 1
        found.channels = len(channels)
        found.attachments = len(content.attachments)
        found.metadata = len(content.metadata)
        counts = {name: str(value) for name, value in msgspec.structs.asdict(found).items()}
        writer.add_metadata(METADATA_NAME, {"source": source.name, **counts})
        writer.finish()  # type: ignore[no-untyped-call]


def _register(writer: Writer, content: LogContent) -> dict[int, int]:
    """Register every channel whose schema is known; return the new identifiers."""
    schemas = {0: 0}
    for schema in content.schemas.values():
        schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
    return {
        channel.id: writer.register_channel(
            channel.topic, channel.message_encoding, schemas[channel.schema_id], channel.metadata
        )
        for channel in content.channels.values()
        if channel.schema_id in schemas
    }


def _verify(path: Path, found: Recovery) -> None:
    """Read the written file by its index.

    Raises LogError where it does not hold what was written.
    """
    try:
        with path.open("rb") as stream:
            reader = make_reader(stream, validate_crcs=True)
            messages = sum(1 for _ in reader.iter_messages())
            attachments = sum(1 for _ in reader.iter_attachments())
    except DAMAGE_ERRORS as error:
        raise LogError(
            f"{path}: the recovered file cannot be read ({error}); is the disk full?"
        ) from error
    if (messages, attachments) != (found.messages, found.attachments):
        raise LogError(
            f"{path}: the recovered file has {messages} of {found.messages} messages and "
            f"{attachments} of {found.attachments} attachments; is the disk full?"
        )
