// SPDX-License-Identifier: GPL-3.0-or-later
// r4 metrics: boards and their links for Prometheus.
#include <fmt/format.h>
#include <prometheus/collectable.h>
#include <prometheus/exposer.h>
#include <prometheus/metric_family.h>

#include <array>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <asio/signal_set.hpp>
#include <asio/steady_timer.hpp>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <future>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "../shell/json.hpp"
#include "../shell/key_file.hpp"
#include "../shell/options.hpp"
#include "../shell/subcommands.hpp"
#include "protocol/messages/state_fields.hpp"
#include "r4link/async_board.hpp"
#include "r4link/error.hpp"
#include "transports/can/can_interface.hpp"
#include "transports/can/can_listener.hpp"
#include "transports/url.hpp"
#include "transports/url_pattern.hpp"

namespace r4::tool {
namespace {

using prometheus::ClientMetric;
using prometheus::MetricFamily;
using prometheus::MetricType;
using Labels = std::vector<ClientMetric::Label>;

struct Options {
  std::vector<std::string> urls;
  std::string listen = "127.0.0.1:9618";
  std::optional<Milliseconds> duration;
  std::string key;
  bool json = false;
};

// Where Prometheus finds no answer it knows that this program hangs.
constexpr std::chrono::seconds longest_collection{2};

// The families of one answer, by name.
class Families {
 public:
  template <class Integer>
  void count(const char* name, const char* help, Labels labels, Integer value) {
    counter(name, help, std::move(labels), static_cast<double>(value));
  }
  void gauge(const char* name, const char* help, Labels labels, double value) {
    ClientMetric metric;
    metric.label = std::move(labels);
    metric.gauge.value = value;
    add(name, help, MetricType::Gauge, std::move(metric));
  }
  void counter(const char* name, const char* help, Labels labels, double value) {
    ClientMetric metric;
    metric.label = std::move(labels);
    metric.counter.value = value;
    add(name, help, MetricType::Counter, std::move(metric));
  }
  std::vector<MetricFamily> take() { return std::move(families_); }

 private:
  void add(const char* name, const char* help, MetricType type, ClientMetric metric) {
    const auto [known, fresh] = index_.try_emplace(name, families_.size());
    if (fresh) {
      families_.emplace_back();
      families_.back().name = name;
      families_.back().help = help;
      families_.back().type = type;
    }
    families_[known->second].metric.push_back(std::move(metric));
  }

  std::map<std::string, std::size_t> index_;
  std::vector<MetricFamily> families_;
};

Labels with(Labels labels, const char* name, std::string value) {
  labels.push_back({name, std::move(value)});
  return labels;
}

// What is told of one board.
void describe(const AsyncBoard& board, Families& out) {
  const BoardIdentity& who = board.identity();
  const LinkStatus& link = board.link();
  const Statistics statistics = board.statistics();
  const ReceivedState& state = board.state();
  const CarrierCounters& carrier = board.carrier_counters();
  const bool up = link.state == HostLinkState::active || link.state == HostLinkState::safe;
  const Labels one{{"url", board.name()}};

  out.gauge("r4_up", "The board is heard.", one, up ? 1 : 0);
  if (!who.board_id.empty()) {
    Labels info = with(with(one, "board", who.name), "hardware_id", who.board_id);
    out.gauge("r4_info", "Who the board is; always 1.",
              with(std::move(info), "firmware", who.firmware), 1);
  }
  for (int i = 0; up && i < safe_reason_count; ++i) {
    const auto reason = static_cast<SafeReason>(i);
    out.gauge("r4_safe", "Why the outputs are off: 1 for the reason that holds, none included.",
              with(one, "reason", to_text(reason)), link.reason == reason ? 1 : 0);
  }
  out.count("r4_received_total", "Datagrams of the board.", one, statistics.received);
  out.count("r4_states_total", "Those of them that are states.", one, statistics.states);
  out.count("r4_damaged_total", "What came and was no datagram.", one, statistics.damaged);
  out.count("r4_lost_total", "Datagrams of the board that never came.", one,
            statistics.packets.lost);
  out.count("r4_duplicates_total", "Datagrams that came again.", one, statistics.packets.duplicate);
  out.count("r4_late_total", "Datagrams that others overtook.", one, statistics.packets.late);
  out.count("r4_restarts_total", "Times the board began again.", one, statistics.packets.restarts);
  out.count("r4_transport_bytes_total", "Bytes of datagrams.", with(one, "direction", "received"),
            carrier.rx_bytes);
  out.count("r4_transport_bytes_total", "", with(one, "direction", "sent"), carrier.tx_bytes);
  out.count("r4_transport_downs_total", "Times the transport was lost.", one, carrier.downs);
  if (!up) return;
  out.gauge("r4_state_rate_hertz", "States a second, over the last.", one,
            statistics.state_rate_hz);
  if (statistics.round_trip_us > 0) {
    out.gauge("r4_round_trip_seconds", "From the newest question to its answer.", one,
              statistics.round_trip_us / 1e6);
  }
  if (!state.any()) return;
  out.gauge("r4_state_age_seconds", "Since the newest state came.", one,
            statistics.state_age_us / 1e6);
  out.gauge("r4_jitter_seconds", "Interarrival jitter of the states (RFC 3550).", one,
            statistics.jitter_us / 1e6);
  if (state.sampled_error != ReceivedState::unknown) {
    out.gauge("r4_clock_error_seconds", "How well the time of a sample is known.", one,
              std::chrono::duration<double>(state.sampled_error).count());
  }
  constexpr std::array<StateField, analog_channels> fields{
      StateField::ain24,  StateField::ain12,    StateField::ain5,
      StateField::aindmh, StateField::ainsteer, StateField::ain6};  // in the order of Analog
  for (int i = 0; i < analog_channels; ++i) {
    const auto input = static_cast<Analog>(i);
    const StateField field = fields[static_cast<std::size_t>(i)];
    if (!state.present.has(field)) continue;
    const Text name = name_of(field);
    out.gauge("r4_analog_volts", "An analog input.",
              with(one, "input", std::string(name.data(), name.size())), state.volts(input));
  }
}

// A CAN interface: how long it was busy, and for which boards.
class BusMetrics {
 public:
  BusMetrics(asio::io_context& io, const CanInterface& interface)
      : name_(interface.name), listener_(io, interface.name, rate_of(interface)) {}

  void describe(Families& out) const {
    std::map<std::string, std::uint64_t> busy_ns;
    for (const auto& [id, traffic] : listener_.survey().traffic()) {
      const CanIdMeaning meaning = classify(id);
      const bool of_a_board = id != CanSurvey::extended_ids && meaning.kind != CanIdKind::other &&
                              meaning.kind != CanIdKind::emergency_stop;
      busy_ns[of_a_board ? std::to_string(meaning.node) : "other"] += traffic.busy_ns;
    }
    for (const auto& [node, ns] : busy_ns) {
      out.counter(
          "r4_can_busy_seconds_total",
          "For how long frames to and from a node took the bus; its rate is the load, 0 to 1.",
          {{"interface", name_}, {"node", node}}, static_cast<double>(ns) / 1e9);
    }
  }

 private:
  // A vcan has no bit rate: it counts as the one that R4 is built for.
  static CanBitRate rate_of(const CanInterface& interface) {
    constexpr std::uint32_t usual = 1'000'000;
    return {interface.bit_rate != 0 ? interface.bit_rate : usual, interface.data_bit_rate};
  }

  const std::string name_;
  CanListener listener_;
};

// What the threads of the HTTP server ask, answered by the thread of the boards.
class Metrics final : public prometheus::Collectable {
 public:
  explicit Metrics(asio::io_context& io) : io_(io) {}

  void add(AsyncBoard& board) { boards_.push_back(&board); }
  void add(const BusMetrics& bus) { buses_.push_back(&bus); }

  std::vector<MetricFamily> Collect() const override {
    const auto answer = std::make_shared<std::promise<std::vector<MetricFamily>>>();
    auto told = answer->get_future();
    asio::post(io_, [this, answer] { answer->set_value(describe_all()); });
    if (told.wait_for(longest_collection) != std::future_status::ready) return {};
    return told.get();
  }

 private:
  std::vector<MetricFamily> describe_all() const {
    Families families;
    for (const AsyncBoard* board : boards_) describe(*board, families);
    for (const BusMetrics* bus : buses_) bus->describe(families);
    return families.take();
  }

  asio::io_context& io_;
  std::vector<const AsyncBoard*> boards_;
  std::vector<const BusMetrics*> buses_;
};

std::unique_ptr<prometheus::Exposer> serve(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  const bool valid = colon != std::string::npos && colon != 0 && colon + 1 != address.size() &&
                     address.find(',') == std::string::npos;
  if (!valid) {
    throw Error(ErrorKind::usage, "--listen " + address, "is not HOST:PORT",
                "write it as in 127.0.0.1:9618, or 0.0.0.0:9618 for other computers");
  }
  try {
    return std::make_unique<prometheus::Exposer>(std::vector<std::string>{
        "listening_ports", address, "num_threads", "2", "request_timeout_ms", "5000"});
  } catch (const std::exception&) {  // it does not say why
    throw Error(
        ErrorKind::open, "--listen " + address, "cannot be listened at",
        "see whether another program has that port, and that the address is this computer's");
  }
}

class MetricsServer {
 public:
  explicit MetricsServer(const Options& options)
      : signals_(io_), end_(io_), metrics_(std::make_shared<Metrics>(io_)) {
    BoardOptions board_options = with_key(options.key);
    board_options.role = BoardRole::watch;
    board_options.session.arming = Arming::off;  // it drives nothing
    for (const std::string& pattern : options.urls) {
      for (const PatternUrl& each : expand_urls(pattern)) {
        boards_.push_back(std::make_unique<AsyncBoard>(io_, each.url, board_options));
        metrics_->add(*boards_.back());
        const Url url = Url::parse(each.url);
        if (url.scheme() == "can") interfaces_.try_emplace(can_interface_of(url));
      }
    }
  }

  int run(const Options& options) {
    for (const auto& board : boards_) board->open();
    for (auto& [name, bus] : interfaces_) {
      bus = std::make_unique<BusMetrics>(io_, can_interface(name));
      metrics_->add(*bus);
    }
    const std::unique_ptr<prometheus::Exposer> exposer = serve(options.listen);
    exposer->RegisterCollectable(metrics_);
    const std::string host = options.listen.substr(0, options.listen.rfind(':'));
    const std::string url =
        fmt::format("http://{}:{}/metrics", host, exposer->GetListeningPorts().front());
    if (options.json) {
      print_line({{"type", "listening"}, {"url", url}, {"boards", boards_.size()}});
    } else {
      fmt::print("{} of {} boards\n", url, boards_.size());
      std::fflush(stdout);
    }
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) signals_.add(number);
    signals_.async_wait([this](const std::error_code&, int) { io_.stop(); });
    if (options.duration) {
      end_.expires_after(*options.duration);
      end_.async_wait([this](const std::error_code&) { io_.stop(); });
    }
    io_.run();
    return 0;
  }

 private:
  asio::io_context io_{1};
  asio::signal_set signals_;
  asio::steady_timer end_;
  std::vector<std::unique_ptr<AsyncBoard>> boards_;
  std::map<std::string, std::unique_ptr<BusMetrics>> interfaces_;
  std::shared_ptr<Metrics> metrics_;
};

int metrics(const Options& options) { return MetricsServer(options).run(options); }

constexpr const char* footer =
    R"(Answers Prometheus at http://127.0.0.1:9618/metrics (docs/metrics.md): of each board whether it is heard,
why its outputs are off, rate, loss, round trip, age and jitter of its states, analog inputs; of each CAN
interface how busy it is, and for which boards. It watches, as r4 monitor does, and takes no control.
--listen 0.0.0.0:9618 answers other computers, too: anybody there may read, and nobody may do more.

Examples:
  r4 metrics udp://192.168.0.125
  r4 metrics 'udp://10.0.0.{1-30}?listen=0' 'can://can0?node=0-7'
  curl -s http://127.0.0.1:9618/metrics | grep r4_safe

Exit codes: 0 ended by --for or Ctrl-C; 2 usage; 4 a transport or the port cannot be opened; 5 permission
denied.)";

}  // namespace

void add_metrics(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  CLI::App* const command = add_subcommand(root, chosen, "metrics", "Tell Prometheus of boards",
                                           footer, options, metrics);
  add_urls(*command, options->urls);
  add_text(*command, "--listen", options->listen, "where it answers (default 127.0.0.1:9618)",
           "HOST:PORT");
  add_seconds(*command, "--for", options->duration, "end after that time");
  add_key(*command, options->key);
  add_json(*command, options->json, "print where it listens as JSON");
}

}  // namespace r4::tool
