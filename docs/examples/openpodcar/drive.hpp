// SPDX-License-Identifier: GPL-3.0-or-later
// The beginning and the steps of a drive, for both programs and their tests.
#pragma once

#include <optional>
#include <r4link/board.hpp>
#include <r4link/setpoints.hpp>
#include <r4link/state.hpp>

#include "course.hpp"
#include "podcar.hpp"

inline constexpr double podcar_cruise_m_s = 1.0;

// If US 1 sees an obstacle, the board goes safe. A board that restarts forgets this threshold.
void guard_podcar(r4::Board& board);

// Arms the board, then calls guard_podcar(). If the board restarts after arming, it is disarmed and
// the loop does not begin. So the vehicle never drives without the guard. Throws r4::Error if the
// board refuses.
void arm_podcar(r4::Board& board);

// The setpoints for this state along the course; none after the vehicle has arrived and stands.
// Throws r4::Error if the steering angle is unknown, or if the vehicle does not obey.
std::optional<r4::Setpoints> follow(Podcar& podcar, Course& course, const r4::State& state,
                                    double dt_s);
