// SPDX-License-Identifier: GPL-3.0-or-later
// One path of a board: its transport, under the number by which the session knows it, and what of it goes into a
// recording.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "r4link/carrier.hpp"
#include "r4link/error.hpp"
#include "recording/recording_tap.hpp"

namespace r4 {

class BoardPath final : public Carrier::Handler {
 public:
  class Owner {
   public:
    virtual void on_datagram(BoardPath& path, std::string_view bytes) = 0;
    virtual void on_drained() = 0;
    virtual void on_carrier_event(BoardPath& path, const CarrierEvent& event) = 0;
    virtual void on_overheard(BoardPath& path, std::string_view bytes) = 0;

   protected:
    ~Owner() = default;
  };

  BoardPath(Owner& owner, std::size_t number, std::unique_ptr<Carrier> transport)
      : index(number), carrier(std::move(transport)), owner_(owner) {}

  void on_datagram(std::string_view bytes, Peer) override { owner_.on_datagram(*this, bytes); }
  void on_drained() override { owner_.on_drained(); }
  void on_carrier_event(const CarrierEvent& event) override {
    owner_.on_carrier_event(*this, event);
  }
  void on_overheard(std::string_view bytes) override { owner_.on_overheard(*this, bytes); }
  void on_oversize(std::string_view beginning) override { tap.on_oversize(beginning); }

  const std::size_t index;
  const std::unique_ptr<Carrier> carrier;
  RecordingTap tap;
  bool opened = false;
  std::optional<Problem> trouble;  // why it could not be opened, as it was told last

 private:
  Owner& owner_;
};

}  // namespace r4
