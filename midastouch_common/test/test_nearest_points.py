import numpy as np
import pytest

from midastouch_common.nearest_points import WORTH_THREADS, NearestPoints


@pytest.mark.parametrize("k", [1, 5])
def test_few_queries_are_answered_as_many_are(k):
    rng = np.random.default_rng(0)
    points = rng.standard_normal((500, 3))
    queries = rng.standard_normal((4 * WORTH_THREADS, 3))
    tree = NearestPoints(points)
    distance, index = tree.query(queries, k)
    expected = np.linalg.norm(queries[:, None] - points, axis=2)
    np.testing.assert_array_equal(index.reshape(len(queries), k), np.argsort(expected, axis=1)[:, :k])
    for i, query in enumerate(queries):
        d, j = tree.query(query[None], k)
        np.testing.assert_array_equal(j[0], index[i])
        np.testing.assert_allclose(d[0], distance[i])
