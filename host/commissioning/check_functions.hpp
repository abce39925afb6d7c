// SPDX-License-Identifier: GPL-3.0-or-later
// One function for each check. The table of checks is in checks.cpp.
#pragma once

#include "checking.hpp"

namespace r4::commissioning {

using CheckFunction = void(Checking&, int channel);
CheckFunction* function_of(const Check& check);

void check_identity(Checking& c, int);
void check_settings(Checking& c, int);
void check_chips(Checking& c, int);
void check_user_bus(Checking& c, int);
void check_uart(Checking& c, int channel);

void check_supply(Checking& c, int input);
void check_handle(Checking& c, int);
void check_encoder(Checking& c, int channel);
void check_ultrasonic(Checking& c, int channel);

void check_motor_supply(Checking& c, int);
void check_relay(Checking& c, int channel);
void check_servo(Checking& c, int channel);
void check_osmc(Checking& c, int channel);
void check_dhb12(Checking& c, int channel);
void check_bldc(Checking& c, int channel);
void check_stepper(Checking& c, int channel);

void check_transports(Checking& c, int);
void check_silence(Checking& c, int);
void check_stop(Checking& c, int);

}  // namespace r4::commissioning
