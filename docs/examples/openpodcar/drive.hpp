// SPDX-License-Identifier: GPL-3.0-or-later
// How a drive begins and goes on, for the programs and their tests.
#pragma once

#include <optional>
#include <r4link/board.hpp>
#include <r4link/setpoints.hpp>
#include <r4link/state.hpp>

#include "course.hpp"
#include "podcar.hpp"

inline constexpr double podcar_cruise_m_s = 1.0;

// Has the board go safe for what US 1 sees. A board that begins again forgets it.
void guard_podcar(r4::Board& board);

// Arms the board, and sets its guard behind that: if it has begun again since, it is not armed any more, and the loop
// does not begin. So nothing drives without the guard, however long it was ago that somebody set it. Throws r4::Error
// where the board refuses.
void arm_podcar(r4::Board& board);

// What to post for this state along the course; nothing once it has arrived and stands. Throws r4::Error if the vehicle
// does not know its steering, or does not obey.
std::optional<r4::Setpoints> follow(Podcar& podcar, Course& course, const r4::State& state,
                                    double dt_s);
