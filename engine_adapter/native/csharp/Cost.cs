// Measures the time of calls from C#, with the world's first body after one second: Cost FOLDER
using System;
using System.Diagnostics;

namespace TaichiSoft
{
    internal static class Cost
    {
        private const int Times = 500;

        private static void Main(string[] arguments)
        {
            using (var scene = new Scene(arguments[0]))
            using (var world = new World(scene))
            {
                Body body = world.GetBody(0);
                int mesh = 0;
                while (scene.GetMeshInfo(mesh).Asset != body.GetAsset()) ++mesh;
                int count = 3 * scene.GetMeshInfo(mesh).VertexCount;
                float[] rows = new float[count], normals = new float[count];
                Action step = () => world.Step(1.0 / 60);
                for (int i = 0; i < 60; ++i) step();
                Say("a step", step, step);
                Say("reading " + count / 3 + " vertices and normals", step, () => body.ReadMesh(mesh, rows, normals));
                Say("a trivial call", step, () => body.GetStatus());
            }
        }

        private static void Say(string what, Action before, Action call)
        {
            var times = new double[Times];
            for (int i = 0; i < Times; ++i)
            {
                before();
                long start = Stopwatch.GetTimestamp();
                call();
                times[i] = (Stopwatch.GetTimestamp() - start) * 1e6 / Stopwatch.Frequency;
            }
            Array.Sort(times);
            Console.WriteLine("{0}: {1:0.0} us at least, median {2:0.0} us", what, times[0], times[Times / 2]);
        }
    }
}
