// SPDX-License-Identifier: GPL-3.0-or-later
// The end of a shared wire at a program that another lets share it.
#pragma once

#include <array>
#include <asio/io_context.hpp>
#include <chrono>
#include <optional>
#include <string>
#include <string_view>

#include "../operation_slot.hpp"
#include "../shared_wire.hpp"
#include "r4link/carrier.hpp"
#include "share_message.hpp"
#include "share_socket.hpp"

namespace r4 {

class WireSharer {
 public:
  // Called on the loop's thread.
  class Owner {
   public:
    virtual void on_message(const ShareMessage& message) = 0;
    virtual void on_all_heard() = 0;  // what had arrived was handed over
    // The holder has ended, or let us go: the connection is closed.
    virtual void on_holder_lost() = 0;

   protected:
    ~Owner() = default;
  };

  WireSharer(asio::io_context& io, Owner& owner) : owner_(owner), connection_(io) {}
  ~WireSharer() { leave(); }
  WireSharer(const WireSharer&) = delete;
  WireSharer& operator=(const WireSharer&) = delete;

  enum class Joined { none, holder, stranger, hanging };
  // Goes to the holder of that wire and says hello. A stranger is told nothing, and one that hangs cannot be when many
  // wait for it: then this waits, too, for `within` at most. Leaves another one only for this. Throws std::system_error
  // if the system does not let the loop wait for it.
  Joined join(const SharedWire& wire, BoardRole role, std::string_view program,
              std::chrono::milliseconds within = {});
  // Waits for its first answer; blocks, for so long at most. `moved` where it has ended. None if none comes. `text` is
  // valid until the next message.
  std::optional<ShareMessage> wait_for_answer(std::chrono::milliseconds within);
  // The process that holds the wire.
  pid_t holder_pid() const { return holder_.pid; }
  // "r4 (pid 123)": the holder.
  std::string holder(std::string_view program) const;
  // It does not answer, or not as we do, or ends what we begin, or is a stranger: what to say of it.
  Problem silence(const std::string& thing) const;
  static Problem silence_of_another(const std::string& thing);  // whose process we do not know
  Problem other_version(const std::string& thing) const;
  Problem turned_away(const std::string& thing) const;
  Problem stranger(const std::string& thing, const SharedWire& wire) const;  // the last one
  // Messages are handed over from now on.
  void listen();
  // An E:STOP for the board.
  SendResult send_stop(std::string_view datagram);
  // It is to say something.
  void ask_whether_alive();
  void leave() noexcept;

 private:
  void receive();
  void lost();

  Owner& owner_;
  LoopDescriptor connection_;
  ShareCredentials holder_;
  ShareCredentials stranger_;
  OperationSlot readable_;
  std::array<char, ShareMessage::max_size + 1> packet_;
};

}  // namespace r4
