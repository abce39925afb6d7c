// SPDX-License-Identifier: GPL-3.0-or-later
// The state fields that a session requests, and whether the board answers. Without I/O.
//                  CMD comes, in control                five F without any answer
//     satisfied <------------------------- asking ----------------------------------> unheard
//         |                                ^    ^                                        |
//         +--------------------------------+    +----------------------------------------+
//          no CMD for 200 ms, or no control            the board sends an answer
//
//     left       the board keeps its own choice of fields, and F is never sent
//     satisfied  the states have CMD, and this host is in control
//     asking     F is sent every 200 ms. An executed F proves that the board obeys this host
//     unheard    the board counts as a board of the paper's release, which does not know F. F is
//                sent once a second, because a bad path may have lost all five F
#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "../measurement/time.hpp"

namespace r4 {

class FieldSelection {
 public:
  enum class Stage : std::uint8_t { left, satisfied, asking, unheard };

  // `fields` as in F; empty: the board keeps its own choice.
  explicit FieldSelection(std::string fields) : fields_(std::move(fields)) {
    if (fields_.empty()) stage_ = Stage::left;
  }

  const std::string& fields() const { return fields_; }
  void choose(std::string fields) {
    fields_ = std::move(fields);
    unanswered_ = 0;
    if (stage_ == Stage::unheard) stage_ = Stage::asking;
  }

  void begin_anew() { next_ = Time{0}; }

  void on_cmd(Time now) {
    cmd_seen_ = now;
    on_answer();
  }
  // The board has sent an answer. A board of the paper's release never answers.
  void on_answer() {
    answers_ = true;
    if (stage_ == Stage::unheard) stage_ = Stage::asking;
  }

  // True if F is due. `may_ask`: the link is up, and no other host controls the board.
  bool ask(bool controlling, bool may_ask, Time now) {
    if (stage_ == Stage::left) return false;
    if (controlling && now - cmd_seen_ < retry) {
      stage_ = Stage::satisfied;
      unanswered_ = 0;
      return false;
    }
    if (!may_ask || now < next_) return false;
    ++unanswered_;
    stage_ = unanswered_ >= most_unanswered && !answers_ ? Stage::unheard : Stage::asking;
    next_ = now + (stage_ == Stage::unheard ? reminder : retry);
    return true;
  }

  Stage stage() const { return stage_; }
  // True if the board's firmware is newer than the paper's release.
  bool answers() const { return answers_; }

 private:
  static constexpr Time retry = std::chrono::milliseconds{200};
  static constexpr Time reminder = std::chrono::seconds{1};
  static constexpr int most_unanswered = 5;

  std::string fields_;
  Stage stage_ = Stage::asking;
  bool answers_ = false;
  int unanswered_ = 0;
  Time cmd_seen_{0};
  Time next_{0};
};

}  // namespace r4
