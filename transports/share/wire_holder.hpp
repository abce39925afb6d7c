// SPDX-License-Identifier: GPL-3.0-or-later
// The end of a shared wire at the program that holds it: tells the others all that passes, and takes stops
// from them. What they cost is bounded: at most 16, for each a few datagrams that wait, and who takes
// nothing for a second, or sends more than 100 messages in one, is let go.
//
//     comes --> silent --hello--> welcome              hears all
//                    \            ^
//                     +--> turned away (16 are there)  its stop is obeyed, and then it hears how
//
// Who is not welcome is cut off after a second, or by eight that came later: whoever comes is heard first, so
// those keep back neither a stop nor a program that controls.
#pragma once

#include <asio/io_context.hpp>
#include <chrono>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "../file_descriptor.hpp"
#include "../operation_slot.hpp"
#include "../shared_wire.hpp"
#include "r4link/carrier.hpp"
#include "share_message.hpp"

namespace r4 {

class WireHolder {
 public:
  static constexpr std::size_t most_sharers = 16;
  static constexpr std::size_t most_stoppers =
      4;  // besides: turned away, but they have stopped the board
  static constexpr std::size_t most_waiting = 8;  // silent, or turned away
  static constexpr std::chrono::milliseconds patience{1000};
  static constexpr int most_messages = 100;  // in a second, of one
  static constexpr std::chrono::milliseconds accept_again{
      100};  // where the system has no descriptor left
  // Connections are taken one a turn of the loop, and at most so many in so long. So no number of programs that connect
  // again and again, of whichever user, takes more than a few percent of the loop's time.
  static constexpr int most_arrivals = 16;
  static constexpr std::chrono::milliseconds arrival_window{5};

  // Called on the loop's thread.
  class Owner {
   public:
    // What those who share the wire know it by.
    virtual const std::string& name() const = 0;
    // A program has come that wants to know how the wire is: a message for it.
    virtual ShareMessage::Kind standing(std::string& text) const = 0;
    // Another program's E:STOP, which is one.
    virtual void on_stop_of_another(std::string_view datagram) = 0;
    // A program has come that wants to control the board. True: let it; the wire must be down by then.
    virtual bool gives_way() = 0;
    // The wire was given to it, and this holder has let it go.
    virtual void on_given_away() = 0;

   protected:
    ~Owner() = default;
  };

  // `program`: what this one is called.
  WireHolder(asio::io_context& io, Owner& owner, std::string program);
  ~WireHolder();
  WireHolder(const WireHolder&) = delete;
  WireHolder& operator=(const WireHolder&) = delete;

  // Holds the wire of that name, instead of another. False if another program does.
  bool hold(const SharedWire& wire);
  // It is the same wire, by another name, or by none: who comes from now on finds it by that, and those that share it
  // stay. False, and nothing is changed, if another program has that name.
  bool rename(const SharedWire& wire);
  // Lets it go.
  void release() noexcept;

  bool holds() const { return !wire_.name.empty(); }
  // Those that hear what is told.
  std::size_t sharers() const;
  // To all who share it, without the secrets in it. `state`: only the newest waits for who is slow.
  void tell(ShareMessage::Kind kind, std::string_view text, Priority priority = Priority::normal);

 private:
  class Sharer;

  LoopDescriptor on_loop(FileDescriptor descriptor);
  void listen_at(LoopDescriptor listener, const SharedWire& wire);
  void stop_listening() noexcept;
  void listen();
  void accept();
  void accept_at(std::chrono::steady_clock::time_point time);
  void take_in(FileDescriptor connection);
  void on_message(Sharer& from, const ShareMessage& message);
  void on_hello(Sharer& from, const ShareMessage& hello);
  void on_stop(Sharer& from, std::string_view datagram);
  void welcome(Sharer& sharer);
  void give_away(Sharer& to);
  std::shared_ptr<Sharer> longest_waiting() const;
  template <class Which>
  std::size_t count(Which which) const;
  void cut_off_in_time();
  void remove_lost_later();

  asio::io_context& io_;
  Owner& owner_;
  const std::string program_;
  SharedWire wire_;
  LoopDescriptor listener_;
  OperationSlot accepting_;
  LoopTimer accept_timer_;
  std::chrono::steady_clock::time_point window_began_;
  int arrivals_ = 0;  // in this window
  OperationSlot removing_;
  OperationSlot giving_away_;
  LoopTimer cut_off_timer_;
  OperationSlot cutting_off_;
  std::vector<std::shared_ptr<Sharer>> sharers_;  // in the order in which they came
};

}  // namespace r4
