// SPDX-License-Identifier: GPL-3.0-or-later
#include "packed_words.hpp"

#include "../../../protocol/datagram/word_index.hpp"

namespace r4 {
namespace packed {
namespace {

using Form = PackedForm;

}  // namespace

// clang-format off
constexpr PackedWord words[word_count] = {
    // 00: state
    {"AIN24", Form::hundredths}, {"AIN12", Form::hundredths}, {"AIN5", Form::hundredths},
    {"AINDMH", Form::hundredths}, {"DMHSTA", Form::flag}, {"AINSTEER", Form::hundredths},
    {"DHB1A", Form::drive}, {"OSMC1", Form::drive}, {"STEP1POS", Form::steps},
    {"SERVO1POS", Form::short3},
    // 0A
    {"AIN6", Form::hundredths}, {"DHB1B", Form::drive}, {"DHB2A", Form::drive},
    {"DHB2B", Form::drive}, {"OSMC2", Form::drive}, {"OSMC3", Form::drive}, {"OSMC4", Form::drive},
    // 11
    {"STEP2POS", Form::steps}, {"STEP3POS", Form::steps}, {"STEP4POS", Form::steps},
    // 14
    {"SERVO2POS", Form::short3}, {"SERVO3POS", Form::short3}, {"SERVO4POS", Form::short3},
    {"SERVO5POS", Form::short3}, {"SERVO6POS", Form::short3}, {"SERVO7POS", Form::short3},
    {"SERVO8POS", Form::short3}, {"SERVO9POS", Form::short3}, {"SERVO10POS", Form::short3},
    {"SERVO11POS", Form::short3}, {"SERVO12POS", Form::short3}, {"SERVO13POS", Form::short3},
    {"SERVO14POS", Form::short3}, {"SERVO15POS", Form::short3}, {"SERVO16POS", Form::short3},
    // 23
    {"ENC1", Form::steps}, {"ENC2", Form::steps}, {"ENC3", Form::steps}, {"ENC4", Form::steps},
    {"US1", Form::count}, {"US2", Form::count}, {"US3", Form::count}, {"US4", Form::count},
    {"BLDC1", Form::bldc}, {"BLDC2", Form::bldc}, {"BLDC3", Form::bldc}, {"BLDC4", Form::bldc},
    {"RELAYS", Form::count},
    // 30
    {"SAFE", Form::flag}, {"CMD", Form::count},
    {"RXOK", Form::count}, {"RXCRC", Form::count}, {"RXLOST", Form::count}, {"RXDUP", Form::count},
    {"RXREF", Form::count}, {"LATE", Form::count},
    // 38: names of other fields
    {"PNum", Form::count}, {"T", Form::count},
    {"H"}, {"O"}, {"D"}, {"S"}, {"R"}, {"E"}, {"P"}, {"Z"}, {"B"}, {"U"}, {"F"}, {"C"}, {"Q"},
    {"N"}, {"I"}, {"A"}, {"AN"},
    // 4B: words of values
    {"R4-ROS2"}, {"ROS2-R4"}, {"On"}, {"Off"}, {"STOP"}, {"CLEAR"}, {"DEFAULT"}, {"ALL"}, {"ID"},
    // 54
    {"rate"}, {"heartbeat"}, {"timeout"}, {"recovery"}, {"pack"}, {"last"}, {"rearm"},
    // 5B
    {"UNKNOWN"}, {"FORMAT"}, {"RANGE"}, {"CHANNEL"}, {"STALE"}, {"DUPLICATE"}, {"BUSY"}, {"AUTH"},
    // 63
    {"R4"}, {"sim"}, {"udp"}, {"serial"}, {"pty"}, {"can"},
    // 69: more of the state
    {"FAULT"},
    {"ENC1HZ", Form::steps}, {"ENC2HZ", Form::steps}, {"ENC3HZ", Form::steps},
    {"ENC4HZ", Form::steps},
    {"ENC1IDX", Form::steps}, {"ENC2IDX", Form::steps}, {"ENC3IDX", Form::steps},
    {"ENC4IDX", Form::steps},
    // 72
    {"I2C1", Form::bytes}, {"I2C2", Form::bytes}, {"I2C3", Form::bytes}, {"I2C4", Form::bytes},
    {"I2C5", Form::bytes}, {"I2C6", Form::bytes}, {"I2C7", Form::bytes}, {"I2C8", Form::bytes},
    {"I2CX", Form::bytes}, {"I2CBUS"}, {"X"}, {"FULL"},
    // 7E
    {"UART1", Form::bytes}, {"UART2", Form::bytes}, {"DAC1", Form::count}, {"DAC2", Form::count},
    {"GPIO", Form::count},
    // 83
    {"SID", Form::session}, {"LEAVE"},
};
// clang-format on

namespace {

static_assert(words[code_servo1pos].word().size() == 9 && words[code_safe].text[0] == 'S' &&
                  words[code_cmd].text[0] == 'C' && words[state_words].text[0] == 'P' &&
                  words[code_r4_ros2].text[1] == '4' && words[code_ros2_r4].text[1] == 'O',
              "the codes by name are those of the table");

constexpr Text word_of(const PackedWord& word) { return word.word(); }
constexpr WordIndex<PackedWord, word_count, word_of> index(words);
static_assert(no_word == no_index, "what is not found has no code");

}  // namespace

unsigned code_of(Text word) { return index.find(word); }

}  // namespace packed
}  // namespace r4
