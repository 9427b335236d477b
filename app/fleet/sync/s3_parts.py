"""A multipart upload to S3 that continues where an earlier one of the same object stopped.

The store keeps the parts of an upload that was not completed. Parts whose MD5 is that of the file are not sent again.
"""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Iterable
from typing import Any

from app.fleet.sync.pace import Pace
from pipeline.common.files.remote_files import patiently
from pipeline.common.progress import Progress

PART_BYTES = 5 << 20
"""The smallest part that S3 accepts: what an interruption can cost, and what is sent in one go where a rate is set."""
_MOST_PARTS = 10_000
_TRIES = 3
"""A part that arrived damaged is sent again."""
_MD5 = re.compile(r"[0-9a-f]{32}")


def part_bytes(size: int) -> int:
    """Bytes of each part but the last: the same for the same size, so that another run knows the parts again."""
    return max(PART_BYTES, -(-size // _MOST_PARTS))


class PartedUpload:
    """One object.

    Args:
        system: s3fs's file system.
        path: of the object in it.
        address: for messages.
    """

    def __init__(self, system: Any, path: str, address: str) -> None:
        self._system, self._address = system, address
        self._bucket, self._key, _ = system.split_path(path)

    def run(self, parts: Iterable[bytes], size: int, pace: Pace, progress: Progress) -> str | None:
        """Upload the object. Returns its SHA-256; None if the store's checksums or its size differ from the data's.

        Args:
            parts: its content, in parts of ``part_bytes(size)`` bytes.
            size: of the whole, in bytes. progress: of these.

        Raises what ``patiently`` raises.
        """
        digest, done, sent = hashlib.sha256(), 0, []
        upload, known = self._begun()
        for number, data in enumerate(parts, 1):
            etag = known.get(number)
            if etag != hashlib.md5(data, usedforsecurity=False).hexdigest():
                pace.sending()
                etag = self._part(upload, number, data)
                if etag is None:
                    return None
                pace.sent(len(data))
            sent.append({"PartNumber": number, "ETag": f'"{etag}"'})
            digest.update(data)
            done += len(data)
            progress(done, size)
        self._call("complete_multipart_upload", UploadId=upload, MultipartUpload={"Parts": sent})
        self._system.invalidate_cache()
        return digest.hexdigest() if self._size() == done else None

    def _begun(self) -> tuple[str, dict[int, str]]:
        """Id of the upload, and part → ETag of what an earlier run has sent of it."""
        listed = self._call_bucket("list_multipart_uploads", Prefix=self._key).get("Uploads") or []
        mine = [each for each in listed if each["Key"] == self._key]
        if not mine:
            return str(self._call("create_multipart_upload")["UploadId"]), {}
        upload = str(max(mine, key=lambda each: each["Initiated"])["UploadId"])
        parts: dict[int, str] = {}
        after = 0
        while True:
            answer = self._call("list_parts", UploadId=upload, PartNumberMarker=after)
            parts |= {int(each["PartNumber"]): str(each["ETag"]).strip('"') for each in answer.get("Parts") or []}
            if not answer.get("IsTruncated"):
                return upload, parts
            after = int(answer["NextPartNumberMarker"])

    def _part(self, upload: str, number: int, data: bytes) -> str | None:
        """Send a part. Returns its ETag; None if it arrived damaged each time."""
        md5 = hashlib.md5(data, usedforsecurity=False)
        check = base64.b64encode(md5.digest()).decode()
        for _ in range(_TRIES):
            answer = self._call("upload_part", UploadId=upload, PartNumber=number, Body=data, ContentMD5=check)
            etag = str(answer["ETag"]).strip('"')
            # with encryption by a key of the customer the ETag is no MD5: there the store's own check of it remains
            is_md5 = _MD5.fullmatch(etag) is not None and "kms" not in str(answer.get("ServerSideEncryption", ""))
            if not is_md5 or etag == md5.hexdigest():
                return etag
        return None

    def _size(self) -> int:
        return int(self._call("head_object")["ContentLength"])

    def _call(self, method: str, **arguments: Any) -> dict[str, Any]:
        return self._call_bucket(method, Key=self._key, **arguments)

    def _call_bucket(self, method: str, **arguments: Any) -> dict[str, Any]:
        answer: dict[str, Any] = patiently(
            lambda: self._system.call_s3(method, Bucket=self._bucket, **arguments), self._address
        )
        return answer
