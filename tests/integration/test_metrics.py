# SPDX-License-Identifier: GPL-3.0-or-later
"""r4 metrics as a program, read by Prometheus' own parser."""
import contextlib
import http.client
import socket
import time
import urllib.error
import urllib.request

import pytest
from prometheus_client.parser import text_string_to_metric_families

from r4_process import ERROR, PATIENCE_S, Board, Running, driving, run

USAGE, OPEN = 2, 4


class Metrics(Running):
    def __init__(self, *urls):
        super().__init__('metrics', '--json', '--listen', '127.0.0.1:0', *urls)
        self.url = self.next(lambda each: each['type'] == 'listening')['url']

    def read(self):
        """Returns the samples, {(name, the labels except the URL): value}, or, with several boards, {url: samples}."""
        with urllib.request.urlopen(self.url, timeout=PATIENCE_S) as answer:
            text = answer.read().decode()
        samples = {}
        for family in text_string_to_metric_families(text):
            assert family.documentation and family.type in ('gauge', 'counter'), family
            for sample in family.samples:
                labels = dict(sample.labels)
                key = (sample.name, *(value for name, value in sorted(labels.items()) if name != 'url'))
                of_board = samples.setdefault(labels.get('url'), {})
                assert key not in of_board, key
                of_board[key] = sample.value
        return samples

    def until(self, is_so):
        deadline = time.monotonic() + PATIENCE_S
        while not is_so(samples := self.read()):
            assert time.monotonic() < deadline, samples
        return samples


def test_metrics_report_the_link_and_states_of_every_board():
    with Board('udp://127.0.0.1:0') as left, Board('udp://127.0.0.1:0') as right:
        with Metrics(left.host_url, right.host_url) as metrics, driving(left.host_url, 'O:358,1,1'):
            def both_are_heard(samples):
                return samples.keys() == {left.host_url, right.host_url} and all(each.get(('r4_state_rate_hertz',), 0) > 90 and
                                                 ('r4_clock_error_seconds',) in each for each in samples.values())
            samples = metrics.until(both_are_heard)
            driven, idle = samples[left.host_url], samples[right.host_url]
            assert driven[('r4_safe', 'none')] == 1 and driven[('r4_safe', 'link')] == 0
            assert idle[('r4_safe', 'none')] == 0 and idle[('r4_safe', 'link')] == 1
            for each in (driven, idle):
                assert each[('r4_up',)] == 1
                assert 23 < each[('r4_analog_volts', 'AIN24')] < 26
                assert each[('r4_states_total',)] > 0 and each[('r4_damaged_total',)] == 0
                assert each[('r4_lost_total',)] == each[('r4_restarts_total',)] == 0
                assert 0 <= each[('r4_state_age_seconds',)] < 1
                assert 0 < each[('r4_round_trip_seconds',)] < 0.1
                assert 0 <= each[('r4_clock_error_seconds',)] < 0.1
                assert any(key[0] == 'r4_info' and 'sim-1' in key for key in each)
            right.end()
            samples = metrics.until(lambda samples: sorted(each[('r4_up',)] for each in samples.values()) == [0, 1])
            [silent] = [each for each in samples.values() if each[('r4_up',)] == 0]
            assert ('r4_state_age_seconds',) not in silent and silent[('r4_states_total',)] > 0


def test_metrics_count_lost_datagrams():
    with Board('udp://127.0.0.1:0', options=('--link', 'loss=20%')) as board, Metrics(board.host_url) as metrics:
        def some_are_lost(samples):
            return any(each.get(('r4_lost_total',), 0) > 0 and each.get(('r4_states_total',), 0) > 0
                       for each in samples.values())
        metrics.until(some_are_lost)


def test_metrics_report_every_path_of_a_board(tmp_path):
    with Board('udp://127.0.0.1:0', f'pty:{tmp_path}/board') as board:
        with Metrics(f'{board.host_url}+serial://{tmp_path}/board') as metrics:
            def of_the_paths(samples, name):
                [one] = samples.values()
                return [value for key, value in one.items() if key[0] == f'r4_path_{name}']
            samples = metrics.until(lambda samples: min(of_the_paths(samples, 'received_total'), default=0) > 10)
            assert of_the_paths(samples, 'carrying') == [1, 1] and sum(of_the_paths(samples, 'copies_total')) > 0
            for name in ('round_trip_seconds', 'age_seconds'):
                assert len(of_the_paths(samples, name)) == 2 and min(of_the_paths(samples, name)) > 0
            board.end()
            metrics.until(lambda samples: sum(of_the_paths(samples, 'carrying')) < 2)
            assert any(key[1:] == (board.host_url,) for key in samples[f'{board.host_url}+serial://{tmp_path}/board'])


def test_a_missing_board_is_reported_as_down():
    with Metrics('udp://127.0.0.1:9?listen=0') as metrics:
        (samples,) = metrics.read().values()
        assert samples[('r4_up',)] == 0 and ('r4_safe', 'none') not in samples
        with pytest.raises(urllib.error.HTTPError):
            urllib.request.urlopen(metrics.url.replace('/metrics', '/other'), timeout=PATIENCE_S)


def test_requests_with_another_host_name_are_refused():
    with Metrics('sim:', '--host', 'robot.example') as metrics:
        port = int(metrics.url.split(':')[2].split('/')[0])

        def status(method, host):
            connection = http.client.HTTPConnection('127.0.0.1', port, timeout=PATIENCE_S)
            connection.request(method, '/metrics', headers={'Host': host})
            answer = connection.getresponse()
            assert bool(answer.read()) == (method == 'GET'), method
            return answer.status
        for host in (f'127.0.0.1:{port}', 'localhost', 'robot.example:9618'):
            assert status('GET', host) == status('HEAD', host) == 200, host
        for host in ('evil.example', '', '192.0.2.1'):
            assert status('GET', host) == 403, host


def test_silent_connections_do_not_delay_a_request():
    with Metrics('udp://127.0.0.1:9?listen=0') as metrics, contextlib.ExitStack() as stack:
        where = metrics.url.split('/')[2].split(':')
        for _ in range(20):
            stack.enter_context(socket.create_connection((where[0], int(where[1])), PATIENCE_S))
        assert metrics.read()


def test_wrong_uses_are_refused(tmp_path):
    for listen, code in (('nowhere', USAGE), ('127.0.0.1:', USAGE), ('192.0.2.1:9618', OPEN)):
        result = run('metrics', 'udp://127.0.0.1?listen=0', '--listen', listen, cwd=tmp_path)
        assert result.returncode == code and ERROR.search(result.stderr), result
    result = run('metrics', 'udp://127.0.0.1:20000-20003?listen=0', 'udp://127.0.0.1:20002?listen=0')
    assert result.returncode == USAGE and 'named twice' in result.stderr, result
    with Metrics('sim:') as metrics:
        taken = metrics.url.split('/')[2]
        result = run('metrics', 'sim:', '--listen', taken)
        assert result.returncode == OPEN and ERROR.search(result.stderr), result
