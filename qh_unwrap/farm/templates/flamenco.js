// SPDX-License-Identifier: GPL-3.0-or-later

// A job type for Flamenco 3: unwrap many files, a chunk of them in each task.  Untested: it was written from what
// Flamenco's own job types look like, and has never run in Flamenco.  All machines have to see the same folders.

const FLAGS = [];

const JOB_TYPE = {
    label: "QH Unwrap",
    description: "Unwrap the files that a list names",
    settings: [
        { key: "list", type: "string", subtype: "file_path", required: true, visible: "submission",
          description: "A text file with the path of a file to unwrap in each line, relative to its own folder" },
        { key: "count", type: "int32", required: true, default: 1, visible: "submission",
          description: "How many files the list has" },
        { key: "folder", type: "string", subtype: "dir_path", required: true, visible: "submission",
          description: "The folder for the unwrapped files" },
        { key: "report", type: "string", subtype: "file_path", required: true, visible: "submission",
          description: "The report, a .csv or .html file" },
        { key: "chunk_size", type: "int32", default: 50, visible: "submission",
          description: "Files in a task" },
        { key: "program", type: "string", default: "qh-unwrap", visible: "submission",
          description: "The program on the machines" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const size = Math.max(1, settings.chunk_size);
    const report = task(settings, "report", ["farm", "report", settings.folder, settings.report]);
    for (let first = 1; first <= settings.count; first += size) {
        const files = `${first}-${Math.min(first + size - 1, settings.count)}`;
        const args = ["--list", settings.list, "--only", files, "-O", settings.folder, "--resume"];
        const unwrap = task(settings, `unwrap-${files}`, args.concat(FLAGS));
        job.addTask(unwrap);
        report.addDependency(unwrap);
    }
    job.addTask(report);
}

function task(settings, name, args) {
    const made = author.Task(name, "misc");
    made.addCommand(author.Command("exec", { exe: settings.program, args: args }));
    return made;
}
