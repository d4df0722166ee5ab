#include "faulty_vfs.hpp"

#include <mutex>
#include <new>
#include <string>

#include <sqlite3.h>

namespace thermocomp::faults {
namespace {

thread_local DiskState* disk_of_thread = nullptr;
sqlite3_vfs* real_vfs = nullptr;

struct File {
  sqlite3_file base;
  DiskState* disk;
  sqlite3_file* real;
};
static_assert(sizeof(File) % 8 == 0);

File& file_of(sqlite3_file* file) {
  return *reinterpret_cast<File*>(file);
}
sqlite3_file* real_of(sqlite3_file* file) {
  return file_of(file).real;
}

/// True if the disk may still be changed.
bool alive(DiskState* disk) {
  if (disk == nullptr || !disk->dying) return true;
  if (disk->writes_left == 0) return false;
  --disk->writes_left;
  return true;
}

int write(sqlite3_file* file, const void* bytes, int size, sqlite3_int64 at) {
  File& mine = file_of(file);
  if (!alive(mine.disk)) return SQLITE_IOERR_WRITE;
  if (mine.disk != nullptr && mine.disk->full) {
    sqlite3_int64 length = 0;
    mine.real->pMethods->xFileSize(mine.real, &length);
    if (at + size > length) {
      ++mine.disk->refused;
      return SQLITE_FULL;
    }
  }
  return mine.real->pMethods->xWrite(mine.real, bytes, size, at);
}
int truncate(sqlite3_file* file, sqlite3_int64 size) {
  if (!alive(file_of(file).disk)) return SQLITE_IOERR_TRUNCATE;
  return real_of(file)->pMethods->xTruncate(real_of(file), size);
}
/// The disk is memory: written data are visible to the next open().
int sync(sqlite3_file* /*file*/, int /*flags*/) {
  return SQLITE_OK;
}
int close(sqlite3_file* file) {
  return real_of(file)->pMethods->xClose(real_of(file));
}
int read(sqlite3_file* file, void* into, int size, sqlite3_int64 at) {
  return real_of(file)->pMethods->xRead(real_of(file), into, size, at);
}
int file_size(sqlite3_file* file, sqlite3_int64* size) {
  return real_of(file)->pMethods->xFileSize(real_of(file), size);
}
int lock(sqlite3_file* file, int kind) {
  return real_of(file)->pMethods->xLock(real_of(file), kind);
}
int unlock(sqlite3_file* file, int kind) {
  return real_of(file)->pMethods->xUnlock(real_of(file), kind);
}
int is_locked(sqlite3_file* file, int* out) {
  return real_of(file)->pMethods->xCheckReservedLock(real_of(file), out);
}
int control(sqlite3_file* file, int operation, void* argument) {
  return real_of(file)->pMethods->xFileControl(real_of(file), operation, argument);
}
int sector_size(sqlite3_file* file) {
  return real_of(file)->pMethods->xSectorSize(real_of(file));
}
int characteristics(sqlite3_file* file) {
  return real_of(file)->pMethods->xDeviceCharacteristics(real_of(file));
}
int shm_map(sqlite3_file* file, int page, int size, int extend, void volatile** out) {
  return real_of(file)->pMethods->xShmMap(real_of(file), page, size, extend, out);
}
int shm_lock(sqlite3_file* file, int offset, int count, int flags) {
  return real_of(file)->pMethods->xShmLock(real_of(file), offset, count, flags);
}
void shm_barrier(sqlite3_file* file) {
  real_of(file)->pMethods->xShmBarrier(real_of(file));
}
int shm_unmap(sqlite3_file* file, int remove) {
  return real_of(file)->pMethods->xShmUnmap(real_of(file), remove);
}

const sqlite3_io_methods methods{
    2,         close,     read,    write,       truncate,        sync,    file_size, lock,
    unlock,    is_locked, control, sector_size, characteristics, shm_map, shm_lock,  shm_barrier,
    shm_unmap, nullptr,   nullptr};

int open(sqlite3_vfs* /*vfs*/, const char* name, sqlite3_file* file, int flags, int* out) {
  File& mine = file_of(file);
  mine.base.pMethods = nullptr;
  mine.disk = disk_of_thread;
  mine.real = reinterpret_cast<sqlite3_file*>(&mine + 1);
  const int code = real_vfs->xOpen(real_vfs, name, mine.real, flags, out);
  if (code == SQLITE_OK) mine.base.pMethods = &methods;
  return code;
}

int remove_file(sqlite3_vfs* /*vfs*/, const char* name, int sync_folder) {
  if (!alive(disk_of_thread)) return SQLITE_IOERR_DELETE;
  return real_vfs->xDelete(real_vfs, name, sync_folder);
}

}  // namespace

void set_disk_of_this_thread(DiskState* disk) noexcept {
  disk_of_thread = disk;
}

void install_faulty_vfs() {
  static std::once_flag once;
  std::call_once(once, [] {
    real_vfs = sqlite3_vfs_find(nullptr);
    static sqlite3_vfs mine = *real_vfs;
    mine.zName = "thermocomp_faulty";
    mine.szOsFile = static_cast<int>(sizeof(File)) + real_vfs->szOsFile;
    mine.pNext = nullptr;
    mine.xOpen = open;
    mine.xDelete = remove_file;
    sqlite3_vfs_register(&mine, 1);
  });
}

}  // namespace thermocomp::faults
