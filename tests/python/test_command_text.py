# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands as text and in words."""
import copy
import pickle

import pytest

import r4link
from r4link import Command


@pytest.mark.parametrize('text, made, words', [
    ('O:358,1,1', Command.osmc(1, pwm=358), 'OSMC 1 forward, duty 0.087'),
    ('O:410,0,1', Command.osmc(1, duty=-0.1), 'OSMC 1 reverse, duty 0.1'),
    ('D:0,1,4', Command.dhb12(4, pwm=0), 'DHB12 4 forward, duty 0'),
    ('B:4095,1,1,2', Command.bldc(2, duty=1, brake=True), 'BLDC 2 forward, duty 1, brake on'),
    ('S:1500,3', Command.servo(3, us=1500), 'servo 3 at 1500 us'),
    ('R:1,On', Command.relay(1, on=True), 'relay 1 on'),
    ('P:-5,1000,2', Command.stepper(2, position=-5), 'stepper 2 to -5 steps at 1000 steps/s'),
    ('Z:2', Command.zero(2), 'encoder and stepper 2 to zero'),
    ('X:DAC,1,1650', Command.dac(1, millivolts=1650), 'DAC 1 at 1650 mV'),
    ('U:50,1', Command.proximity(1, cm=50), 'proximity sensor 1 below 50 cm'),
    ('E:STOP', Command.stop(), 'stop every output'),
    ('E:CLEAR', Command.clear(), 'clear the safe state'),
])
def test_a_command_has_a_text_and_a_description(text, made, words):
    for command in (Command.parse(text), Command.parse(text + ';'), made):
        assert str(command) == text and command.describe() == words


@pytest.mark.parametrize('text, words', [
    ('C:rate,50', 'setting rate 50'),
    ('C:password,letmein!', 'setting password ...'),
    ('F:DEFAULT,ENC1', 'send fields DEFAULT,ENC1'),
    ('X:WRITE,104,x6B00', 'write x6B00 to I2C device 0x68'),
    ('C:name,a-name-that-is-longer-than-most', 'setting name a-name-that-is-longer-than-most'),
])
def test_copies_of_a_command_keep_its_text_and_description(text, words):
    command = Command.parse(text)
    for each in (command, copy.copy(command), copy.deepcopy(command), pickle.loads(pickle.dumps(command))):
        assert str(each) == text and each.describe() == words


@pytest.mark.parametrize('text, fault', [
    ('', 'this is not a command'), ('V:1,1', 'this is not a command'), ('O:1,1', 'form'), ('O:5000,1,1', 'range'),
    ('O:1,1,5', 'channel'), ('O:1,1,1;O:1,1,2', 'O:1,1,1'),
])
def test_a_wrong_text_is_refused_with_a_reason(text, fault):
    with pytest.raises(r4link.UsageError, match=fault):
        Command.parse(text)


def test_a_parsed_command_can_be_sent_and_added_to_setpoints(board, sim, wait):
    board.arm()
    board.send(Command.parse('O:358,1,1'))
    board.send(r4link.Setpoints(Command.parse('O:410,1,2')).add(Command.parse('S:1500,3')))
    wait(lambda: (sim.look().osmc[0].pwm, sim.look().osmc[1].pwm) == (358, 410))
    board.send(Command.parse('C:rate,50'))
