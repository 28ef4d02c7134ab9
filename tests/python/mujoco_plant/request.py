"""A request to the daemon, as a person makes one."""

import time

PATIENCE_S = 30.0


def ask(contract, node, instance, kind, deadline_ns):
    """Sends a request and waits until it is done; `deadline_ns` is of the daemon's clock."""
    client = contract.open(node, instance, "request").client_builder().create()
    request = contract.classes["RequestSample"]()
    request.id, request.kind, request.deadline_ns = 1, kind, deadline_ns
    pending = client.loan_uninit().write_payload(request).send()
    end = time.monotonic() + PATIENCE_S
    while time.monotonic() < end:
        response = pending.receive()
        if response is None:
            time.sleep(0.001)
            continue
        answer = response.payload().contents
        if contract.enum_name("ResponseStatus", answer.status) != "Done":
            raise RuntimeError(f"the daemon refused: {bytes(answer.text[: answer.text_length]).decode()}")
        return
    raise TimeoutError(f"no response within {PATIENCE_S} s")
