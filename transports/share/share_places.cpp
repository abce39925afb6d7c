// SPDX-License-Identifier: GPL-3.0-or-later
#include "share_places.hpp"

#include <cerrno>
#include <utility>

#include "../file_descriptor.hpp"
#include "share_message.hpp"
#include "share_socket.hpp"

namespace r4 {

void SharePlaces::begin() { begin(find_()); }

void SharePlaces::begin(SharedWire wire) {
  wire_ = std::move(wire);
  stranger_.reset();
  forget();
}

void SharePlaces::follow() {
  SharedWire wire = find_();
  if (wire.name != wire_.name) begin(std::move(wire));
}

void SharePlaces::rename() {
  SharedWire wire;
  try {
    wire = find_();
  } catch (const Error&) {  // nobody looks for it by any name
  }
  if (wire.name == wire_.name) return;
  begin(std::move(wire));
  for (int place = 0; place < share_places && !wire_.name.empty(); ++place) {
    if (holder_.rename(at_place(wire_, place))) return;
  }
  holder_.rename({});
}

void SharePlaces::forget() {
  passed_over_ = 0;
  one_hangs_ = false;
  no_help_.reset();
}

WireSharer::Joined SharePlaces::join(int place, BoardRole role, const std::string& thing,
                                     const Patience& patience) {
  if (wire_.name.empty() || is_passed_over(place)) return WireSharer::Joined::none;
  const SharedWire there = at_place(wire_, place);
  const auto joined = with_system_errors(thing, [&] {
    return sharer_.join(there, role, program_invocation_short_name, patience.queue);
  });
  if (joined == WireSharer::Joined::hanging) {
    one_hangs_ = true;
    pass_over(place, WireSharer::silence_of_another(thing));
  }
  if (joined == WireSharer::Joined::stranger) {
    stranger_ = sharer_.stranger(thing, there);
    passed_over_ |= 1U << place;
  }
  return joined;
}

bool SharePlaces::join(const std::string& thing, const Patience& patience) {
  int place = share_places;
  do {
    if (place-- == 0) return false;
  } while (join(place, BoardRole::watch, thing, patience) != WireSharer::Joined::holder);
  joined_ = place;
  stranger_.reset();
  return true;
}

// Those that hang come first: who watches has the wire until then.
void SharePlaces::ask_for_wire(const std::string& thing, const Patience& patience) {
  for (int place = 0; place < share_places; ++place) {
    if (join(place, BoardRole::control, thing, patience) != WireSharer::Joined::holder) continue;
    joined_ = place;
    const std::optional<ShareMessage> answer = sharer_.wait_for_answer(patience.answer);
    if (!answer) {
      pass_over_hanging(thing);
    } else if (!answer->same_version) {
      pass_over_other_version(thing);
    } else if (answer->kind == ShareMessage::Kind::busy) {
      throw Error(ErrorKind::refused, thing, "controlled by " + sharer_.holder(answer->text),
                  "end that program, or watch beside it, as r4 monitor does");
    }
  }
  sharer_.leave();
}

bool SharePlaces::hold(const std::string& thing) {
  if (wire_.name.empty()) return true;
  for (int place = 0; place < share_places; ++place) {
    if (is_passed_over(place)) continue;
    errno = 0;
    if (!holder_.hold(at_place(wire_, place))) {
      if (const auto problem = out_of_resources(thing, errno)) throw Error(*problem);
      return false;
    }
    stranger_.reset();
    return true;
  }
  return true;
}

bool SharePlaces::somebody_has_come() const {
  if (wire_.name.empty()) return false;
  for (int place = 0; place < share_places; ++place) {
    if (!is_passed_over(place) && reach_holder(at_place(wire_, place)).connection) return true;
  }
  return false;
}

void SharePlaces::pass_over_hanging(const std::string& thing) {
  one_hangs_ = true;
  pass_over(joined_, sharer_.silence(thing));
}

void SharePlaces::pass_over_other_version(const std::string& thing) {
  pass_over(joined_, sharer_.other_version(thing));
}

void SharePlaces::pass_over(int place, Problem why) {
  passed_over_ |= 1U << place;
  no_help_ = std::move(why);
}

std::optional<Problem> SharePlaces::take_stranger() { return std::exchange(stranger_, {}); }

}  // namespace r4
