// A component for Unity that steps a world file. SoftBodyBehaviour.cs draws the bodies.
//
// No Unity has run this file. Mono's compiler has compiled it against stubs/UnityEngine.cs, and a test has run it so.
using System;
using System.IO;
using UnityEngine;

namespace TaichiSoft
{
    /// <summary>A world file of StreamingAssets, exported with `--axes unity`, that moves while this is enabled.</summary>
    // Before others, which may use World in their Start, and the impulses of a step in their FixedUpdate.
    [DefaultExecutionOrder(-100)]
    public sealed class SoftWorldBehaviour : MonoBehaviour
    {
        /// <summary>A collider or frame of the world file, and what it follows.</summary>
        [Serializable]
        public struct Follower
        {
            /// <summary>Its name in the world file.</summary>
            public string name;
            /// <summary>What it follows.</summary>
            public Transform target;
        }

        [SerializeField, Tooltip("Folder in StreamingAssets, written by: taichi-soft export --axes unity")]
        private string folder = "game.softworld";

        [SerializeField, Tooltip("Colliders that follow game objects")]
        private Follower[] colliders = new Follower[0];

        [SerializeField, Tooltip("Frames that follow game objects")]
        private Follower[] frames = new Follower[0];

        private int[] colliderNumbers, frameNumbers;
        private float fixedStep;
        private double ahead; // of the last step, put in by Update [s]

        /// <summary>What is in the file. Null before Awake and after OnDestroy.</summary>
        public Scene Scene { get; private set; }

        /// <summary>What moves. Null before Awake and after OnDestroy.</summary>
        public World World { get; private set; }

        /// <summary>Its time after the last call.</summary>
        public Clock Clock { get; private set; }

        private void Awake()
        {
            Scene = new Scene(Path.Combine(Application.streamingAssetsPath, folder)); // compiles kernels: seconds
            World = new World(Scene);
            colliderNumbers = NumbersOf(NameKind.Collider, colliders);
            frameNumbers = NumbersOf(NameKind.Frame, frames);
        }

        private int[] NumbersOf(NameKind kind, Follower[] followers)
        {
            var numbers = new int[followers.Length];
            for (int i = 0; i < numbers.Length; ++i) numbers[i] = Scene.Find(kind, followers[i].name);
            return numbers;
        }

        // Unity calls this once a step, and Update once a frame. Update puts in the part of a step that the picture
        // is ahead of the last one, and this the rest: so each call of this makes one step, and alpha is right.
        private void FixedUpdate()
        {
            if (fixedStep != Time.fixedDeltaTime)
            {
                fixedStep = Time.fixedDeltaTime;
                World.SetFixedStep(fixedStep); // forgets what Update has put in
                ahead = 0;
            }
            for (int i = 0; i < colliderNumbers.Length; ++i)
            {
                World.MoveCollider(colliderNumbers[i], PoseOf(colliders[i].target));
            }
            for (int i = 0; i < frameNumbers.Length; ++i)
            {
                World.MoveFrame(frameNumbers[i], PoseOf(frames[i].target));
            }
            Clock = World.Advance(fixedStep - ahead);
            ahead = 0;
        }

        private void Update()
        {
            if (fixedStep == 0) return; // no step yet
            double now = Math.Min((double)Time.time - Time.fixedTime, 0.999 * fixedStep);
            if (now <= ahead) return;
            Clock = World.Advance(now - ahead);
            ahead = now;
        }

        private void OnDestroy()
        {
            if (World != null) World.Dispose();
            if (Scene != null) Scene.Dispose();
            World = null;
            Scene = null;
        }

        private static Pose PoseOf(Transform target)
        {
            Vector3 p = target.position;
            Quaternion r = target.rotation;
            return new Pose(new Vector3d(p.x, p.y, p.z), new Quaterniond(r.x, r.y, r.z, r.w));
        }
    }
}
