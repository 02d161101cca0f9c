import numpy as np
import pytest

from midastouch_common.errors import InputError

torch = pytest.importorskip("torch")

from midastouch_perception.onnx_network import OnnxNetwork, network_path  # noqa: E402
from midastouch_perception.tcn.network import CodeNet  # noqa: E402
from midastouch_simulation.training.export import unfold  # noqa: E402
from midastouch_simulation.training.tdn import UNet, export  # noqa: E402


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """A network whose normalisations have seen something, and its export."""
    torch.manual_seed(0)
    model = UNet()
    with torch.no_grad():
        for layer in model.modules():
            if isinstance(layer, torch.nn.BatchNorm2d):
                layer.running_mean.normal_()
                layer.running_var.uniform_(0.5, 2)
                layer.weight.uniform_(0.5, 1.5)
                layer.bias.normal_()
    return export(model.eval(), {"network": "tdn"}, tmp_path_factory.mktemp("net") / "tdn.onnx")


def batch() -> tuple[torch.Tensor, torch.Tensor]:
    return tuple(torch.randn(4, 3, 160, 120, generator=torch.Generator().manual_seed(s)) for s in (1, 2))


def test_a_new_network_computes_the_same(exported):
    model = UNet()
    unfold(model, exported, *batch())
    difference, geometry = batch()
    expected = OnnxNetwork("tdn", exported).run(difference.numpy(), geometry.numpy())
    with torch.no_grad():
        np.testing.assert_allclose(model.eval()(difference, geometry).numpy(), expected, atol=2e-3)
        # and hardly anything else with the statistics of the batch, as in training
        trained = model.train()(difference, geometry).numpy()
    assert np.abs(trained - expected).mean() < 0.05 * np.abs(expected).mean()


def test_the_shipped_code_network_can_be_trained_on():
    path = network_path("tcn", "fast")
    maps = torch.rand(8, 4, 80, 60, generator=torch.Generator().manual_seed(3))
    model = CodeNet()
    unfold(model, path, maps)
    with torch.no_grad():
        codes = model.eval()(maps).numpy()
    np.testing.assert_allclose(codes, OnnxNetwork("tcn", path).run(maps.numpy()), atol=1e-4)


def test_another_architecture_is_refused(exported):
    with pytest.raises(InputError, match=r"\.onnx: .*start from another"):
        unfold(UNet((8, 16, 32)), exported, *batch())
