"""What a file is that is no recording: said by its first bytes, not by its name."""

from __future__ import annotations

SIGNATURES: tuple[tuple[bytes, str], ...] = (
    (b"\x89PNG\r\n\x1a\n", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"GIF8", "a GIF picture"),
    (b"%PDF-", "a PDF document"),
    (b"PK\x03\x04", "a ZIP archive (an .npz, .xlsx or .zip)"),
    (b"PK\x05\x06", "an empty ZIP archive"),
    (b"\x1f\x8b", "a gzip archive: unpack it first"),
    (b"BZh", "a bzip2 archive: unpack it first"),
    (b"\xfd7zXZ\x00", "an xz archive: unpack it first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7z archive: unpack it first"),
    (b"\x28\xb5\x2f\xfd", "a zstd archive: unpack it first"),
    (b"PAR1", "a Parquet file"),
    (b"ARROW1", "an Arrow file"),
    (b"\x93NUMPY", "a single NumPy array (.npy): save with numpy.savez and names"),
    (b"\x89HDF\r\n\x1a\n", "an HDF5 file"),
    (b"MATLAB 7.3 MAT-file", "a MATLAB 7.3 file"),
    (b"MATLAB 5.0 MAT-file", "a MATLAB 5 file"),
    (b"\x89MCAP0\r\n", "an MCAP file: give the folder of the ROS 2 bag, with its metadata.yaml"),
    (b"SQLite format 3\x00", "an SQLite database: give the folder of the ROS 2 bag, with its metadata.yaml"),
    (b"#ROSBAG V", "a ROS 1 bag"),
    (b"RIFF", "a RIFF file (sound or film)"),
    (b"\x7fELF", "a program"),
    (b"MZ", "a Windows program"),
    (b"\x80\x04", "a Python pickle, which is never opened: it can run code"),
    (b"\x80\x05", "a Python pickle, which is never opened: it can run code"),
    (b"\xd0\xcf\x11\xe0", "an old Office document"),
    (b"{\\rtf", "an RTF document"),
)

TEXT_BOMS = (b"\xff\xfe", b"\xfe\xff", b"\xef\xbb\xbf")


def is_text(head: bytes) -> bool:
    """Whether the first bytes of a file look like text."""
    if head.startswith(TEXT_BOMS):
        return True
    control = sum(byte < 32 and byte not in (9, 10, 12, 13) for byte in head)
    return bool(head) and control == 0 and kind(head) is None


def kind(head: bytes) -> str | None:
    """What the first bytes say that a file is, in words; None where they say nothing."""
    for signature, words in SIGNATURES:
        if head.startswith(signature):
            return words
    start = head.lstrip()[:200].lower()
    if start.startswith((b"<!doctype html", b"<html")):
        return "a web page"
    if start.startswith(b"<?xml"):
        return "an XML file"
    if start[:1] in (b"{", b"[") and b'"' in start:
        return "a JSON file"
    return None
