// SPDX-License-Identifier: GPL-3.0-or-later
// A recording started from a page. A thread of its own waits for the disk.
//     off --begin()--> opening --opened--> on --end(), or the disk is full--> off
//                         |                     end() during opening: as soon as it is on
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
    std::string path;
    std::uint64_t bytes = 0;
    std::string why;  // why recording failed or ended
  };
  // `use` passes the recording to the boards; `tell` gets each change. Both run on the loop.
  WebRecording(asio::io_context& io, std::string folder, std::function<void(Recording&)> use,
               std::function<void(const Told&)> tell);
  // Blocks until the disk is done.
  ~WebRecording();

  void begin(Client client);
  void end();
  bool is_of(Client client) const { return stage_ != Stage::off && client_ == client; }
  // Call once a second: updates the size, and detects the end after a full disk.
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
  Client client_ = 0;
  bool ends_at_once_ = false;
  Told told_;
  asio::thread_pool disk_{1};
};

}  // namespace r4::tool::web
