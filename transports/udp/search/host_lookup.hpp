// SPDX-License-Identifier: GPL-3.0-or-later
// Where the host of a name is, without holding up the event loop.
//
// The system's resolver blocks, for 10 s where no name server answers. So it is asked in a thread for
// each question, which nobody waits for: Asio's resolver joins its thread when the loop goes, and the
// program would not end before the system gives up.
#pragma once

#include <asio/io_context.hpp>
#include <asio/ip/address.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "../../operation_slot.hpp"
#include "r4link/error.hpp"

namespace r4 {

struct FoundHost {
  std::vector<asio::ip::address> addresses;  // empty: there is none
  std::string reason;                        // why there is none
  // Of a search for boards (board_search.hpp):
  std::string board_id = {};            // of the board that was found
  std::optional<Problem> problem = {};  // why it cannot be told which one it is; its thing is empty
};

// Who knows where hosts are, and how long things take.
struct HostLookup {
  // Blocks; called in threads of their own.
  using Resolve = std::function<FoundHost(const std::string& host)>;
  static FoundHost ask_system(const std::string& host);

  Resolve resolve = ask_system;
  std::chrono::milliseconds patience{5000};  // find() waits for an answer
  std::chrono::milliseconds retry{1000};     // ask again where there is none
  std::chrono::milliseconds silence{3000};   // look again when nothing was heard for so long

  // The address of `host`, which may be one. Blocks until the answer is there. Throws Error about
  // `thing` if there is none in time.
  asio::ip::address find(const std::string& host, const std::string& thing) const;
};

// The one to use of those found, IPv4 first, as the board's WiFi has it. Throws Error about `thing`
// if there is none.
asio::ip::address address_of(const FoundHost& found, const std::string& host,
                             const std::string& thing);

// Is it an address, not a name?
bool is_address(const std::string& host);

// Keeps asking where a board is: until it is known, and again when it is silent.
class HostWatch {
 public:
  HostWatch(asio::io_context& io, HostLookup lookup);
  HostWatch(const HostWatch&) = delete;
  HostWatch& operator=(const HostWatch&) = delete;
  ~HostWatch() { stop(); }

  using Question = std::function<FoundHost()>;  // blocks; asked in threads of their own
  using OnFound = std::function<void(const FoundHost&)>;
  // Calls `on_found`, on the loop, with each answer. It begins by asking, unless it is known where the
  // board is.
  void start(Question question, bool known, OnFound on_found);
  // The same without a question: calls `on_silence` each time.
  void start(std::function<void()> on_silence);
  // From now on that is asked.
  void ask_for(Question question) { what_to_ask_ = std::move(question); }
  // No call follows. What was asked is left to itself.
  void stop();

  void set_known(bool known) { known_ = known; }
  // Does it matter whether something is heard now? Then tell.
  bool listens() const { return !heard_; }
  void heard() { heard_ = true; }

 private:
  struct Asked;
  void ask();
  void wait();

  asio::io_context& io_;
  const HostLookup lookup_;
  Question what_to_ask_;
  OnFound on_found_;
  std::function<void()> on_silence_;
  bool known_ = false;
  bool heard_ = true;
  LoopTimer timer_;
  OperationSlot waiting_;
  std::shared_ptr<Asked> asked_;  // null: none is under way
};

}  // namespace r4
