"""What users are told survives the way out of a worker process."""

import pickle

from hsop_gcs.errors import BadInput


def test_bad_input_can_be_pickled() -> None:
    error = pickle.loads(pickle.dumps(BadInput("n_hosts", "1 is outside 2..4")))
    assert (error.field, error.problem, str(error)) == ("n_hosts", "1 is outside 2..4", "n_hosts: 1 is outside 2..4")
