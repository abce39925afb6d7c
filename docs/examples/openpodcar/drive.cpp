// SPDX-License-Identifier: GPL-3.0-or-later
#include "drive.hpp"

#include <cmath>
#include <r4link/error.hpp>

void guard_podcar(r4::Board& board) { board.proximity(1, r4::Centimetres(podcar_clearance_cm)); }

void arm_podcar(r4::Board& board) {
  board.arm();
  guard_podcar(board);
}

std::optional<r4::Setpoints> follow(Podcar& podcar, Course& course, const r4::State& state,
                                    double dt_s) {
  if (!podcar.sense(state)) {
    throw r4::Error(r4::ErrorKind::refused, "AINSTEER",
                    "the steering sensor shows an angle that the steering cannot have",
                    "look at its cable, and at podcar_steering");
  }
  if (!podcar.obeys()) {
    throw r4::Error(r4::ErrorKind::refused, "the vehicle",
                    "steering or speed is not as commanded",
                    "look at DHB1A, AINSTEER and encoder 1: does forward steer to the left "
                    "and count upwards?");
  }
  const auto wish = course.wish(podcar.pose(), podcar_cruise_m_s);
  if (course.finished() && std::abs(podcar.speed_m_s()) < 0.02) return std::nullopt;
  return podcar.drive(wish, dt_s);
}
