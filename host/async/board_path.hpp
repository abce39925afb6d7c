// SPDX-License-Identifier: GPL-3.0-or-later
// The paths of a board: a transport, its number in the session, and a tap for recordings.
#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "../recording/recording_tap.hpp"
#include "r4link/carrier.hpp"
#include "r4link/error.hpp"

namespace r4 {

template <class Owner>
class BoardPath final : public Carrier::Handler {
 public:
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
  std::optional<Problem> trouble;  // why the transport is not open, after open()

 private:
  Owner& owner_;
};

template <class Owner>
class BoardPaths {
 public:
  using Path = BoardPath<Owner>;

  BoardPaths(Owner& owner, std::vector<std::unique_ptr<Carrier>> transports) {
    for (std::unique_ptr<Carrier>& each : transports) {
      paths_.push_back(std::make_unique<Path>(owner, paths_.size(), std::move(each)));
    }
  }

  std::size_t size() const { return paths_.size(); }
  Path& operator[](std::size_t path) const { return *paths_[path]; }
  auto begin() const { return paths_.begin(); }
  auto end() const { return paths_.end(); }

  void close() {
    for (const auto& path : paths_) path->carrier->close();
  }
  // The names of the transports. Programs call it with each state, so it allocates nothing.
  const std::string& name() {
    name_.clear();
    for (const auto& path : paths_) {
      if (!name_.empty()) name_ += ' ';
      name_ += path->carrier->name();
    }
    return name_;
  }
  const CarrierCounters& counters() {
    counters_ = CarrierCounters();
    for (const auto& path : paths_) counters_ += path->carrier->counters();
    return counters_;
  }
  // The last path's trouble; none if at least one path has no trouble.
  TransportTrouble trouble() const {
    TransportTrouble common = TransportTrouble::none;
    for (const auto& path : paths_) {
      common = path->carrier->trouble();
      if (common == TransportTrouble::none) break;
    }
    return common;
  }

 private:
  std::vector<std::unique_ptr<Path>> paths_;
  std::string name_;
  CarrierCounters counters_;
};

}  // namespace r4
