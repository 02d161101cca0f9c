from pathlib import Path

import numpy as np
import pytest

from midastouch_perception.training.setting import TrainingOptions

torch = pytest.importorskip("torch")

from midastouch_perception.training.run import TrainingRun  # noqa: E402


def test_the_averaged_weights_are_normalised_by_what_they_make_of_the_last_batches(tmp_path):
    """Not by running statistics of weights that were still jumping about."""
    torch.manual_seed(0)

    def build():
        convolution = torch.nn.Conv2d(1, 8, 3, bias=False)
        return torch.nn.Sequential(convolution, torch.nn.BatchNorm2d(8), torch.nn.ReLU(), torch.nn.Conv2d(8, 1, 1))

    def loss_of(model, batch):
        return (model(batch) - batch.mean()).square().mean()

    options = TrainingOptions(Path(), Path(), None, tmp_path, steps=60)
    run = TrainingRun(build(), options, rate=1.0)
    batches = [torch.randn(4, 1, 12, 12) for _ in range(80)]
    run.fit(batches, loss_of, dict, every=30)
    model = run.averaged(build)
    with torch.no_grad():
        seen = torch.cat([model[0](batch) for batch in batches[44:60]])
    np.testing.assert_allclose(model[1].running_mean, seen.mean(dim=(0, 2, 3)), atol=1e-4)
    np.testing.assert_allclose(model[1].running_var, seen.var(dim=(0, 2, 3)), rtol=0.05)
    assert not model.training
    of_the_steps = run.average["1.running_var"] / model[1].running_var
    assert np.abs(of_the_steps - 1).max() > 0.02, "both are the same: nothing was tested"
