// SPDX-License-Identifier: GPL-3.0-or-later
// Where those that share a wire meet: at the first of a few names of which no holder hangs. That one is passed over from
// then on by who has seen it, and is found again by who comes when it goes on.
//
//     place    0          1          2    3
//     holder   hangs      hangs      A         who comes looks from the last to the first, and finds A;
//     holder   hangs      B          -         B has come when A was gone: the first that is of use
#pragma once

#include <chrono>
#include <optional>
#include <utility>

#include "../shared_wire.hpp"
#include "r4link/error.hpp"
#include "r4link/options.hpp"
#include "wire_holder.hpp"
#include "wire_sharer.hpp"

namespace r4 {

class SharePlaces {
 public:
  // How long a call may block.
  struct Patience {
    std::chrono::milliseconds queue;   // where many programs wait for a holder
    std::chrono::milliseconds answer;  // of a holder that is asked
  };

  SharePlaces(FindWire find, WireHolder& holder, WireSharer& sharer)
      : find_(std::move(find)), holder_(holder), sharer_(sharer) {}

  // Throws Error if the wire is not to be found.
  void begin();
  // Begins anew if the wire is called otherwise now. Throws Error as begin() does.
  void follow();
  // What we hold is called otherwise now, or nothing while it is not to be found: by that name it is found by who comes.
  // A device that goes leaves its place to the next, for the number of a pty is another's at once; when it comes again,
  // it may be in another.
  void rename();
  // All are of use again.
  void forget();

  // Joins the holder who came last, to watch. False if none is of use.
  bool join(const std::string& thing, const Patience& patience);
  // Asks each holder to let go of the wire, and waits for its answer. Throws Error{refused} if one controls the board.
  void ask_for_wire(const std::string& thing, const Patience& patience);
  // Takes the first that is of use, or none if none is: then nobody shares what we open. False if another has it.
  // Throws Error{open} if the system has no file, memory or watch left for it.
  bool hold(const std::string& thing);

  const SharedWire& wire() const { return wire_; }

  // A place that is of use has a holder.
  bool somebody_has_come() const;

  // The holder that was joined is no help.
  void pass_over_hanging(const std::string& thing);
  void pass_over_other_version(const std::string& thing);
  bool joined_is_passed_over() const { return is_passed_over(joined_); }
  bool one_hangs() const { return one_hangs_; }
  // Why the last one that was passed over is no help.
  const std::optional<Problem>& no_help() const { return no_help_; }
  // A stranger has a place, and we have none.
  std::optional<Problem> take_stranger();

 private:
  WireSharer::Joined join(int place, BoardRole role, const std::string& thing,
                          const Patience& patience);
  bool is_passed_over(int place) const { return (passed_over_ >> place & 1U) != 0; }
  void pass_over(int place, Problem why);

  void begin(SharedWire wire);

  const FindWire find_;
  WireHolder& holder_;
  WireSharer& sharer_;
  SharedWire wire_;
  int joined_ = 0;
  unsigned passed_over_ = 0;  // a bit for each
  bool one_hangs_ = false;
  std::optional<Problem> no_help_;
  std::optional<Problem> stranger_;
};

}  // namespace r4
