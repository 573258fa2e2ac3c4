"""Model files whose metadata were changed and signed again."""

import hashlib

import onnx

from soilml.onboard.model_file import metadata_checksum, serialise_metadata


def signed(source, path, **entries):
    """A file whose metadata have these entries, None for one that is left out.

    source: A file or a model.
    """
    model = source if isinstance(source, onnx.ModelProto) else onnx.load(source)
    metadata = {e.key: e.value for e in model.metadata_props} | entries
    metadata = {key: value for key, value in metadata.items() if value is not None}
    del model.metadata_props[:]
    graph = model.SerializeToString(deterministic=True)
    metadata["graph_sha256"] = hashlib.sha256(graph).hexdigest()
    metadata["metadata_sha256"] = metadata_checksum(metadata)
    path.write_bytes(graph + serialise_metadata(metadata))
    return path
