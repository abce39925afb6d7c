// SPDX-License-Identifier: GPL-3.0-or-later
#include "sim_carrier.hpp"

#include <limits>
#include <utility>

#include "../../../transports/memory_carrier.hpp"
#include "simulated_board.hpp"

namespace r4::sim {

namespace {

// The host's end of a memory pair, with the board that has the other end.
class SimCarrier final : public Carrier {
 public:
  SimCarrier(std::unique_ptr<SimulatedBoard> board, std::unique_ptr<Carrier> end)
      : board_(std::move(board)), end_(std::move(end)) {}

  void open(Handler& handler) override {
    board_->start();  // first, so that the end is up at once
    end_->open(handler);
  }
  void close() noexcept override {
    end_->close();
    board_->stop();
  }
  SendResult send(std::string_view bytes, Priority priority, Peer to) override {
    return end_->send(bytes, priority, to);
  }
  bool up() const override { return end_->up(); }
  std::size_t max_size() const override { return end_->max_size(); }
  const std::string& name() const override { return end_->name(); }
  const CarrierCounters& counters() const override { return end_->counters(); }

 private:
  std::unique_ptr<SimulatedBoard> board_;
  std::unique_ptr<Carrier> end_;
};

}  // namespace

std::unique_ptr<Carrier> make_sim_carrier(asio::io_context& io, const Url& url) {
  url.allow_only("node seed script");
  if (!url.host().empty() || !url.path().empty()) {
    throw Error(ErrorKind::usage, url.text(), "a simulated board has no place",
                "write sim: or, for another board, sim:?node=2");
  }
  SimulatedBoard::Options options;
  options.board_id = "sim-" + std::to_string(url.get_number("node", 0, 31, 1));
  if (url.get("seed")) {
    constexpr long max = std::numeric_limits<long>::max();
    options.seed = static_cast<std::uint64_t>(url.get_number("seed", 0, max, 0));
  }
  if (const auto script = url.get("script")) options.script = Script::load(*script);
  auto [host_end, board_end] = make_memory_pair(io, url.text());
  auto board = std::make_unique<SimulatedBoard>(io, std::move(options));
  board->add_carrier(std::move(board_end));
  return std::make_unique<SimCarrier>(std::move(board), std::move(host_end));
}

}  // namespace r4::sim
