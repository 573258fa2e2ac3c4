"""Training by the text of a spec."""

from training.dataset import read_dataset
from training.spec import read_spec
from training.train import train


def trained_by(text, data, folder):
    """What a spec of this text makes of a file of rows; the spec is written in `folder`."""
    (folder / "spec.toml").write_text(text)
    spec = read_spec(folder / "spec.toml")
    return train(spec, read_dataset(data, spec.features, spec.targets))
