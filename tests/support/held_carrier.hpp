// SPDX-License-Identifier: GPL-3.0-or-later
// A transport that blocks the loop on request, which no real transport does.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "host/standard_registry.hpp"
#include "r4link/async_board.hpp"
#include "r4link/board.hpp"
#include "tests/support/carriers.hpp"

namespace r4::test {

class Hold {
 public:
  CarrierMaker at(const std::string& url) {
    return [turn = turn_, url](Loop& loop) {
      return std::make_unique<Held>(standard_registry().make(context_of(loop), url, Role::host),
                                    turn);
    };
  }
  // Blocks the loop at the next send().
  void begin() { turn_->reach(Turn::Stage::wanted); }
  bool wait_until_held() { return turn_->wait_for(Turn::Stage::held); }
  void release() { turn_->reach(Turn::Stage::released); }

 private:
  // This object is shared, so that it exists while either thread uses it.
  class Turn {
   public:
    enum class Stage : std::uint8_t { free, wanted, held, released };
    void reach(Stage stage) {
      const std::lock_guard lock(mutex_);
      stage_ = stage;
      changed_.notify_all();
    }
    bool wait_for(Stage stage) {
      std::unique_lock lock(mutex_);
      return changed_.wait_for(lock, std::chrono::seconds{5}, [&] { return stage_ >= stage; });
    }
    bool is(Stage stage) {
      const std::lock_guard lock(mutex_);
      return stage_ == stage;
    }

   private:
    std::mutex mutex_;
    std::condition_variable changed_;
    Stage stage_ = Stage::free;
  };

  class Held final : public WrappedCarrier {
   public:
    Held(std::unique_ptr<Carrier> below, std::shared_ptr<Turn> turn)
        : WrappedCarrier(std::move(below)), turn_(std::move(turn)) {}
    SendResult send(std::string_view bytes, Priority priority, Peer to) override {
      if (turn_->is(Turn::Stage::wanted)) {
        turn_->reach(Turn::Stage::held);
        turn_->wait_for(Turn::Stage::released);
      }
      return WrappedCarrier::send(bytes, priority, to);
    }

   private:
    std::shared_ptr<Turn> turn_;
  };

  std::shared_ptr<Turn> turn_ = std::make_shared<Turn>();
};

}  // namespace r4::test
