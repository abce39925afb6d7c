# SPDX-License-Identifier: GPL-3.0-or-later
"""Uses the package repeatedly, on an interpreter that counts all references. Exit code 1 if their number grows. Leaves
out r4link.read(), because numpy is not built for this interpreter, which does not count the references of numpy."""
import gc
import os
import sys
import tempfile
import threading

import r4link


def use_all_of_it(sim):
    board = r4link.Board(sim.url, arming=False)
    told = threading.Event()
    board.on_state(lambda state: board.name and told.set())
    board.on_link(lambda link: link.as_dict())
    board.on_event(lambda event: event.as_dict())
    with tempfile.TemporaryDirectory() as folder:
        with r4link.Recording(os.path.join(folder, 'x.r4log')) as recording:
            board.record(recording)
            board.wait_active()
            states = board.states(lossless=True)
            for state in states:
                repr(state)
                state.as_dict()
                break
            told.wait(5)
            board.send(r4link.Setpoints(r4link.Command.osmc(1, pwm=5), r4link.Command.servo(1, us=1500)))
            for wrong in (lambda: board.osmc(9).set(0.1), lambda: board.send('nonsense'),
                          lambda: sim.happen('nonsense')):
                try:
                    wrong()
                except r4link.Error:
                    pass
            board.identify().as_dict()
            board.statistics.as_dict()
            sim.look()
            board.close()
            list(states)


USES, WINDOW, MOST_ROUNDS = 10, 3, 12


def main():
    sim = r4link.SimBoard()
    counts = []
    grown = None
    # Caches fill in the first rounds (four in Python 3.13), and a count varies by about ten. If each use leaks one
    # reference, every window of three rounds of ten uses grows by 30.
    while len(counts) < MOST_ROUNDS and (grown is None or grown >= 2 * USES):
        for _ in range(USES):
            use_all_of_it(sim)
        gc.collect()
        counts.append(sys.gettotalrefcount())
        if len(counts) > WINDOW:
            grown = counts[-1] - counts[-1 - WINDOW]
    print('references:', counts)
    sys.exit(grown >= 2 * USES)


if __name__ == '__main__':
    main()
