// Job type of Blender's Flamenco 3: renders a glTF scene with relief. Goes into the folder `scripts` beside flamenco-manager.
// Frames are rendered in chunks; with parts, the samples of each frame are shared by as many tasks, which relief merge joins.

const JOB_TYPE = {
    label: "relief",
    description: "Renders a glTF scene with relief",
    settings: [
        { key: "scene", type: "string", subtype: "file_path", required: true,
          description: "glTF scene, where all workers can read it" },
        { key: "output", type: "string", subtype: "file_path", required: true,
          description: "OpenEXR files to write; #### stands for the frame" },
        { key: "frames", type: "string", required: true,
          eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
          evalInfo: { showLinkButton: true, description: "Scene frame range" },
          description: "Frames, such as 47, 1-30 or 3, 5-10, 47-327" },
        { key: "chunk_size", type: "int32", default: 1, description: "Frames of a task" },
        { key: "parts", type: "int32", default: 1, description: "Tasks that share the samples of a frame" },
        { key: "options", type: "string", default: "",
          description: "Further options of relief render, with spaces between them" },
        { key: "program", type: "string", default: "{relief}", visible: "hidden",
          description: "The program; {relief} is a variable of the manager's configuration" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const output = outputParts(settings.output);
    const options = (settings.options || "").split(" ").filter((word) => word !== "");
    for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
        const frames = chunk.replaceAll(" ", "");
        if (settings.parts <= 1) {
            job.addTask(renderTask(settings, frames, `render-${frames}`, output.stem + output.suffix, options));
            continue;
        }
        const files = [];
        const merge = author.Task(`merge-${frames}`, "misc");
        for (let part = 1; part <= settings.parts; part++) {
            const file = `${output.stem}.part-${part}-of-${settings.parts}${output.suffix}`;
            // Halves would be rounded before they are added.
            const partOptions = ["--part", `${part}/${settings.parts}`, "--float"].concat(options);
            const task = renderTask(settings, frames, `render-${frames}-part-${part}`, file, partOptions);
            job.addTask(task);
            merge.addDependency(task);
            files.push(file);
        }
        merge.addCommand(author.Command("exec", {
            exe: settings.program,
            args: ["merge", "--frames", frames].concat(files, ["-o", output.stem + output.suffix]),
        }));
        job.addTask(merge);
    }
}

// What is done already is left out, so that a task may be tried again.
function renderTask(settings, frames, name, file, options) {
    const task = author.Task(name, "misc");
    task.addCommand(author.Command("exec", {
        exe: settings.program,
        args: ["render", settings.scene, "-o", file, "--frames", frames, "--resume"].concat(options),
    }));
    return task;
}

// A name without # gets the number before its suffix, as relief does it.
function outputParts(output) {
    const suffix = ".exr";
    const stem = output.toLowerCase().endsWith(suffix) ? output.slice(0, -suffix.length) : output;
    return { stem: stem.includes("#") ? stem : `${stem}.####`, suffix: suffix };
}
