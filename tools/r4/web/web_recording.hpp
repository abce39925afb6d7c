// SPDX-License-Identifier: GPL-3.0-or-later
// The recording that a page of r4 web begins. Disks may take their time: a thread of its own waits for them, and the
// boards' loop never does.
//
//     off --begin()--> opening --opened--> on --end(), or the disk is full--> off
//                         |                     end() while it is opened: as soon as it is on
//                         +--it cannot be opened--> off
#pragma once

#include <asio/io_context.hpp>
#include <asio/thread_pool.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "r4link/recording.hpp"

namespace r4::tool::web {

class WebRecording {
 public:
  using Client = std::uint32_t;
  struct Told {
    std::string path;  // empty: nothing is recorded
    std::uint64_t bytes = 0;
    std::string why;  // it is not, or not any more
  };
  // `use` hands the recording to the boards; `tell` is told what has changed. Both are called on
  // the loop.
  WebRecording(asio::io_context& io, std::string folder, std::function<void(Recording&)> use,
               std::function<void(const Told&)> tell);
  // Waits for the disk.
  ~WebRecording();

  // Nothing happens if something is recorded already.
  void begin(Client client);
  void end();
  // True if this client has begun what is recorded.
  bool is_of(Client client) const { return stage_ != Stage::off && client_ == client; }
  // Once a second: how large it is, and whether it has ended by itself, for the disk is full.
  void look();
  const Told& told() const { return told_; }

 private:
  enum class Stage : std::uint8_t { off, opening, on };

  void opened(std::shared_ptr<Recording> recording, std::string path);
  void failed(const std::string& why);
  void close(const std::string& why);

  asio::io_context& io_;
  const std::string folder_;
  const std::function<void(Recording&)> use_;
  const std::function<void(const Told&)> tell_;
  std::shared_ptr<Recording> recording_;
  Stage stage_ = Stage::off;
  Client client_ = 0;          // that has begun it
  bool ends_at_once_ = false;  // it was ended while it was opened
  Told told_;
  asio::thread_pool disk_{1};
};

}  // namespace r4::tool::web
