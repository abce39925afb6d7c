// SPDX-License-Identifier: GPL-3.0-or-later
#include "web_recording.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <asio/post.hpp>
#include <ctime>
#include <filesystem>
#include <optional>
#include <system_error>
#include <utility>

#include "r4link/error.hpp"

namespace r4::tool::web {

WebRecording::WebRecording(asio::io_context& io, std::string folder,
                           std::function<void(Recording&)> use,
                           std::function<void(const Told&)> tell)
    : io_(io), folder_(std::move(folder)), use_(std::move(use)), tell_(std::move(tell)) {}

WebRecording::~WebRecording() { disk_.join(); }

void WebRecording::begin(Client client) {
  if (stage_ != Stage::off) return;
  stage_ = Stage::opening;
  client_ = client;
  ends_at_once_ = false;
  std::tm now{};
  const std::time_t seconds = std::time(nullptr);
  ::localtime_r(&seconds, &now);
  std::string path = fmt::format("{}/r4-{:%Y%m%d-%H%M%S}.r4log.zst", folder_, now);
  asio::post(disk_, [this, path = std::move(path)] {
    try {
      auto recording = std::make_shared<Recording>(path);
      asio::post(io_, [this, recording, path] { opened(recording, path); });
    } catch (const Error& error) {
      asio::post(io_, [this, why = std::string(error.what())] { failed(why); });
    }
  });
}

void WebRecording::opened(std::shared_ptr<Recording> recording, std::string path) {
  stage_ = Stage::on;
  recording_ = std::move(recording);
  told_ = {std::move(path), 0, ""};
  use_(*recording_);
  tell_(told_);
  if (ends_at_once_) end();
}

void WebRecording::failed(const std::string& why) {
  stage_ = Stage::off;
  told_ = {"", 0, why};
  tell_(told_);
}

void WebRecording::end() {
  ends_at_once_ = stage_ == Stage::opening;
  if (stage_ == Stage::on) close("");
}

void WebRecording::close(const std::string& why) {
  stage_ = Stage::off;
  asio::post(disk_, [recording = std::move(recording_)] { recording->close(); });
  recording_.reset();
  told_ = {"", told_.bytes, why};
  tell_(told_);
}

void WebRecording::look() {
  if (!recording_) return;
  if (const std::optional<Problem> problem = recording_->problem()) {
    if (problem->kind != ErrorKind::data) return close(problem->text());
    told_.why = problem->text();  // the file was removed or truncated; recording continues
  }
  asio::post(disk_, [this, path = told_.path] {
    std::error_code none;
    const std::uintmax_t size = std::filesystem::file_size(path, none);
    if (none) return;
    asio::post(io_, [this, path, size] {
      if (told_.path != path) return;
      told_.bytes = size;
      tell_(told_);
    });
  });
}

}  // namespace r4::tool::web
